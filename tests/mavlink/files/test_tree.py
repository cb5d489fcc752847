"""The vehicle's files: memory and disk do the same, nothing leads out of a folder, a tree shows its parts."""

import os
import socket
from collections.abc import Callable
from errno import EACCES, EINVAL, EISDIR, ENOENT, ENOSPC, ENOTDIR
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from colibri.mavlink.files.folder import Folder
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Entry, Files, Names, OpenFile, Quota, Tree, can_be_new, names_of

QUOTA = Quota(200, 6)
LONG = "x" * 256

NAMES = st.lists(st.sampled_from(["a", "b", "c", "tab\there", LONG]), max_size=3).map(tuple)
OFFSETS = st.integers(0, 150)
DATA = st.binary(max_size=60)
OPERATIONS = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(["list", "open", "create", "remove", "make_folder", "remove_folder"]), NAMES),
        st.tuples(st.just("write"), NAMES, OFFSETS, DATA),
        st.tuples(st.just("truncate"), NAMES, OFFSETS),
        st.tuples(st.just("rename"), NAMES, NAMES),
    ),
    max_size=40,
)


def content(files: Files, names: Names) -> bytes:
    reading = files.open(names)
    return reading.read(0, reading.size)


def refusal(operation: Callable[..., object], *arguments: object) -> int:
    """Return the errno of an operation that must be refused."""
    with pytest.raises((OSError, UnicodeEncodeError)) as caught:
        operation(*arguments)
    return getattr(caught.value, "errno", EINVAL)


def outcome_of(operation: Callable[..., object], *arguments: object) -> object:
    try:
        outcome = operation(*arguments)
    except OSError as error:
        return error.errno
    if isinstance(outcome, list):
        return [entry._replace(modified_s=0) for entry in outcome]
    if isinstance(outcome, OpenFile):
        return outcome.size, outcome.read(0, 1000), outcome.read(5, 3), outcome.read(1000, 5)
    return outcome


@given(operations=OPERATIONS)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_memory_and_disk_do_the_same(operations: list[tuple[object, ...]], tmp_path_factory: object) -> None:
    path: Path = tmp_path_factory.mktemp("files")  # type: ignore[attr-defined]
    folder, memory = Folder(path, QUOTA), MemoryFiles(QUOTA)
    for name, *arguments in operations:
        of_disk = outcome_of(getattr(folder, str(name)), *arguments)
        of_memory = outcome_of(getattr(memory, str(name)), *arguments)
        if LONG in str(arguments):  # the disk may find out earlier
            assert isinstance(of_disk, int) == isinstance(of_memory, int)
        else:
            assert of_disk == of_memory, (name, arguments)
    again = Folder(path, QUOTA)  # which counts what the first one left
    assert (again._size, again._entries) == (folder._size, folder._entries)  # noqa: SLF001
    folder.close()
    again.close()


@pytest.mark.parametrize(
    "make", [lambda path: Folder(path, QUOTA), lambda _: MemoryFiles(QUOTA)], ids=["folder", "memory"]
)
def test_quota(make: object, tmp_path: Path) -> None:
    files: Files = make(tmp_path / "q")  # type: ignore[operator]
    for name in "abcde":
        files.create((name,))
    files.make_folder(("f",))
    assert refusal(files.create, ("g",)) == ENOSPC
    assert refusal(files.make_folder, ("g",)) == ENOSPC
    files.create(("a",))  # which exists
    files.write(("a",), 199, b"x")
    assert refusal(files.write, ("b",), 0, b"x") == ENOSPC
    assert refusal(files.write, ("a",), 0xFFFFFFFF, b"x") == ENOSPC
    files.write(("a",), 100, b"y" * 100)
    files.truncate(("a",), 150)
    files.write(("b",), 0, b"x" * 50)
    assert refusal(files.write, ("b",), 50, b"x") == ENOSPC
    files.remove(("a",))
    files.write(("b",), 50, b"x" * 150)
    files.create(("g",))


def refused_changes(files: Files, names: Names) -> None:
    refusal(files.create, names)
    refusal(files.write, names, 0, b"owned")
    refusal(files.truncate, names, 0)
    refusal(files.remove, names)
    refusal(files.rename, names, ("elsewhere",))
    refusal(files.rename, ("mine",), names)
    refusal(files.make_folder, names)
    refusal(files.remove_folder, names)


def test_nothing_leads_out_of_a_folder(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "secret").write_bytes(b"secret")
    root = tmp_path / "root"
    folder = Folder(root)
    folder.create(("mine",))
    (root / "link").symlink_to(outside / "secret")
    (root / "way").symlink_to(outside)
    (root / "up").symlink_to("..")
    os.mkfifo(root / "pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(root / "socket"))
    hostile: list[Names] = [
        ("link",),
        ("way", "secret"),
        ("up", "outside", "secret"),
        ("..", "outside", "secret"),
        ("../outside/secret",),
        (str(outside / "secret"),),
        ("pipe",),
        ("socket",),
        ("mine\0",),
        ("\ud800",),
        ("",),
        (".",),
        ("/",),
        ("x" * 5000,),
        ("a/b",),
    ]
    for names in hostile:
        refused_changes(folder, names)
        refusal(folder.list, names)
        refusal(folder.open, names)
    assert folder.list(()) == [Entry("mine", False, 0, int((root / "mine").stat().st_mtime))]
    assert (outside / "secret").read_bytes() == b"secret"
    assert [path.name for path in outside.iterdir()] == ["secret"]
    assert sorted(path.name for path in root.iterdir()) == ["link", "mine", "pipe", "socket", "up", "way"]
    folder.close()


def test_a_folder_swapped_for_a_link_leads_nowhere(tmp_path: Path) -> None:
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret").write_bytes(b"secret")
    folder = Folder(tmp_path / "root")
    folder.make_folder(("a",))
    folder.create(("a", "secret"))
    reading = folder.open(("a", "secret"))
    (tmp_path / "root" / "a").rename(tmp_path / "root" / "b")
    (tmp_path / "root" / "a").symlink_to(tmp_path / "outside")
    refusal(reading.read, 0, 6)
    refusal(folder.write, ("a", "secret"), 0, b"x")
    folder.close()


def test_what_vanishes_is_not_found(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.create(("a",))
    folder.write(("a",), 0, b"hello")
    reading = folder.open(("a",))
    assert reading.read(1, 3) == b"ell"
    (tmp_path / "a").unlink()
    assert refusal(reading.read, 0, 5) == ENOENT
    folder.close()
    refusal(folder.list, ())


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("/", ()),
        ("", ()),
        (".", ()),
        ("a/b", ("a", "b")),
        ("//a//./b/", ("a", "b")),
        ("a/../b", ENOENT),
        ("a\0b", ENOENT),
        ("a/" * 17, EINVAL),
        ("ü" * 128, EINVAL),
    ],
)
def test_paths(path: str, names: object) -> None:
    assert outcome_of(names_of, path) == names


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\tb", "a\nb", "\x1b[2J", "\ud800", "x" * 256])
def test_names_that_nobody_could_list_again_are_refused(name: str) -> None:
    assert not can_be_new(name)
    refusal(MemoryFiles().create, (name,))


@pytest.fixture
def tree() -> Tree:
    logs = MemoryFiles()
    logs.create(("1.ulg",))
    logs.write(("1.ulg",), 0, b"log")
    root = MemoryFiles()
    root.create(("mine",))
    root.make_folder(("logs",))  # hidden behind the mount
    root.create(("logs", "hidden"))
    generated = {"general.json": lambda _: b"{}", "@PARAM/param.pck": lambda query: b"<" + query.encode() + b">"}
    return Tree(root, {"logs": logs}, generated, {"@MAV_LOG": "logs"})


def test_a_tree_shows_everything(tree: Tree) -> None:
    assert tree.list(()) == [
        Entry("@MAV_LOG", True),
        Entry("@PARAM", True),
        Entry("general.json", False, 2),
        Entry("logs", True),
        Entry("mine", False, 0),
    ]
    assert tree.list(("@PARAM",)) == [Entry("param.pck", False, 2)]
    assert tree.list(("logs",)) == tree.list(("@MAV_LOG",)) == [Entry("1.ulg", False, 3)]
    assert refusal(tree.list, ("general.json",)) == ENOTDIR
    assert refusal(tree.list, ("nope",)) == ENOENT


def test_a_tree_opens_everything(tree: Tree) -> None:
    assert content(tree, ("general.json",)) == b"{}"
    assert content(tree, ("@PARAM", "param.pck?withdefaults=1")) == b"<withdefaults=1>"
    assert content(tree, ("logs", "1.ulg")) == content(tree, ("@MAV_LOG", "1.ulg")) == b"log"
    assert refusal(tree.open, ("@PARAM",)) == EISDIR
    assert refusal(tree.open, ("logs",)) == EISDIR
    assert refusal(tree.open, ("logs", "hidden")) == ENOENT
    assert refusal(tree.open, ("mine?query",)) == ENOENT


def test_a_folder_has_a_second_path() -> None:
    root = MemoryFiles()
    root.make_folder(("logs",))
    tree = Tree(root, {}, {}, {"@MAV_LOG": "logs"})
    tree.create(("@MAV_LOG", "a"))
    assert content(tree, ("logs", "a")) == b""
    assert tree.list(("@MAV_LOG",)) == tree.list(("logs",)) == [Entry("a", False, 0)]
    tree.rename(("@MAV_LOG", "a"), ("b",))
    assert refusal(tree.remove_folder, ("@MAV_LOG",)) == EACCES
    assert tree.list(()) == [Entry("@MAV_LOG", True), Entry("b", False), Entry("logs", True)]


def test_what_is_generated_stays_as_it_was_when_opened() -> None:
    contents = iter([b"one", b"three"])
    tree = Tree(MemoryFiles(), {}, {"g": lambda _: next(contents)})
    first, second = tree.open(("g",)), tree.open(("g",))
    assert (first.size, first.read(0, 9), second.size, second.read(0, 9)) == (3, b"one", 5, b"three")


@pytest.mark.parametrize("names", [(), ("logs",), ("@PARAM",), ("general.json",), ("@PARAM", "param.pck")])
def test_what_it_is_made_of_stays(tree: Tree, names: Names) -> None:
    before = tree.list(())
    refused_changes(tree, names)
    assert tree.list(()) == before


def test_mounts_can_be_written_to(tree: Tree) -> None:
    tree.remove(("@MAV_LOG", "1.ulg"))
    assert tree.list(("logs",)) == []
    tree.make_folder(("d",))
    tree.rename(("mine",), ("d", "mine"))
    tree.write(("d", "mine"), 0, b"data")
    assert content(tree, ("d", "mine")) == b"data"
    assert refusal(tree.rename, ("d", "mine"), ("@MAV_LOG", "mine")) == EACCES
    tree.truncate(("d", "mine"), 2)
    assert content(tree, ("d", "mine")) == b"da"
    tree.remove(("d", "mine"))
    tree.remove_folder(("d",))
