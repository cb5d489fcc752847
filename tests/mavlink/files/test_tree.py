"""The vehicle's files: memory and disk do the same, nothing leads out of a folder, a tree shows its parts."""

import os
import socket
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from colibri.mavlink.files.folder import Folder
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Entry, FileRefusal, Files, Names, OpenFile, Quota, Tree, can_be_new, names_of

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
    assert isinstance(reading, OpenFile)
    data = reading.read(0, reading.size)
    assert isinstance(data, bytes)
    return data


def plain(outcome: object) -> object:
    if isinstance(outcome, list):
        return [entry._replace(modified_s=0) for entry in outcome]
    if isinstance(outcome, OpenFile):
        return outcome.size, outcome.read(0, 1000), outcome.read(5, 3), outcome.read(1000, 5)
    return outcome


@given(operations=OPERATIONS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_memory_and_disk_do_the_same(operations: list[tuple[object, ...]], tmp_path_factory: object) -> None:
    path: Path = tmp_path_factory.mktemp("files")  # type: ignore[attr-defined]
    folder, memory = Folder(path, QUOTA), MemoryFiles(QUOTA)
    for name, *arguments in operations:
        of_disk = getattr(folder, str(name))(*arguments)
        of_memory = getattr(memory, str(name))(*arguments)
        if LONG in str(arguments):  # the disk may find out earlier
            assert isinstance(of_disk, FileRefusal) == isinstance(of_memory, FileRefusal)
        else:
            assert plain(of_disk) == plain(of_memory), (name, arguments)
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
        assert files.create((name,)) is None
    assert files.make_folder(("f",)) is None
    assert files.create(("g",)) is FileRefusal.NO_SPACE
    assert files.make_folder(("g",)) is FileRefusal.NO_SPACE
    assert files.create(("a",)) is None  # which exists
    assert files.write(("a",), 199, b"x") is None
    assert files.write(("b",), 0, b"x") is FileRefusal.NO_SPACE
    assert files.write(("a",), 0xFFFFFFFF, b"x") is FileRefusal.NO_SPACE
    assert files.write(("a",), 100, b"y" * 100) is None
    assert files.truncate(("a",), 150) is None
    assert files.write(("b",), 0, b"x" * 50) is None
    assert files.write(("b",), 50, b"x") is FileRefusal.NO_SPACE
    assert files.remove(("a",)) is None
    assert files.write(("b",), 50, b"x" * 150) is None
    assert files.create(("g",)) is None


def changes(files: Files, names: Names) -> list[object]:
    return [
        files.create(names),
        files.write(names, 0, b"owned"),
        files.truncate(names, 0),
        files.remove(names),
        files.rename(names, ("elsewhere",)),
        files.rename(("mine",), names),
        files.make_folder(names),
        files.remove_folder(names),
        files.list(names),
        files.open(names),
    ]


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
        outcomes = changes(folder, names)
        assert all(isinstance(outcome, FileRefusal) for outcome in outcomes), (names, outcomes)
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
    assert isinstance(reading, OpenFile)
    (tmp_path / "root" / "a").rename(tmp_path / "root" / "b")
    (tmp_path / "root" / "a").symlink_to(tmp_path / "outside")
    assert isinstance(reading.read(0, 6), FileRefusal)
    assert isinstance(folder.write(("a", "secret"), 0, b"x"), FileRefusal)
    folder.close()


def test_what_vanishes_is_not_found(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.create(("a",))
    folder.write(("a",), 0, b"hello")
    reading = folder.open(("a",))
    assert isinstance(reading, OpenFile)
    assert reading.read(1, 3) == b"ell"
    (tmp_path / "a").unlink()
    assert reading.read(0, 5) is FileRefusal.NOT_FOUND
    folder.close()
    assert folder.list(()) is FileRefusal.FAILED  # whatever the system says: a handle that is closed


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("/", ()),
        ("", ()),
        (".", ()),
        ("a/b", ("a", "b")),
        ("//a//./b/", ("a", "b")),
        ("a/../b", FileRefusal.NOT_FOUND),
        ("a\0b", FileRefusal.NOT_FOUND),
        ("a/" * 17, FileRefusal.BAD_NAME),
        ("ü" * 128, FileRefusal.BAD_NAME),
    ],
)
def test_paths(path: str, names: object) -> None:
    assert names_of(path) == names


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "a\tb", "a\nb", "\x1b[2J", "\ud800", "x" * 256])
def test_names_that_nobody_could_list_again_are_refused(name: str) -> None:
    assert not can_be_new(name)
    assert isinstance(MemoryFiles().create((name,)), FileRefusal)


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
    assert tree.list(("general.json",)) is FileRefusal.NOT_A_FOLDER
    assert tree.list(("nope",)) is FileRefusal.NOT_FOUND


def test_a_tree_opens_everything(tree: Tree) -> None:
    assert content(tree, ("general.json",)) == b"{}"
    assert content(tree, ("@PARAM", "param.pck?withdefaults=1")) == b"<withdefaults=1>"
    assert content(tree, ("logs", "1.ulg")) == content(tree, ("@MAV_LOG", "1.ulg")) == b"log"
    assert tree.open(("@PARAM",)) is FileRefusal.IS_FOLDER
    assert tree.open(("logs",)) is FileRefusal.IS_FOLDER
    assert tree.open(("logs", "hidden")) is FileRefusal.NOT_FOUND
    assert tree.open(("mine?query",)) is FileRefusal.NOT_FOUND


def test_a_folder_has_a_second_path() -> None:
    root = MemoryFiles()
    root.make_folder(("logs",))
    tree = Tree(root, {}, {}, {"@MAV_LOG": "logs"})
    assert tree.create(("@MAV_LOG", "a")) is None
    assert content(tree, ("logs", "a")) == b""
    assert tree.list(("@MAV_LOG",)) == tree.list(("logs",)) == [Entry("a", False, 0)]
    assert tree.rename(("@MAV_LOG", "a"), ("b",)) is None
    assert tree.remove_folder(("@MAV_LOG",)) is FileRefusal.PROTECTED
    assert tree.list(()) == [Entry("@MAV_LOG", True), Entry("b", False), Entry("logs", True)]


def test_what_is_generated_stays_as_it_was_when_opened() -> None:
    contents = iter([b"one", b"three"])
    tree = Tree(MemoryFiles(), {}, {"g": lambda _: next(contents)})
    first, second = tree.open(("g",)), tree.open(("g",))
    assert isinstance(first, OpenFile)
    assert isinstance(second, OpenFile)
    assert (first.size, first.read(0, 9), second.size, second.read(0, 9)) == (3, b"one", 5, b"three")


@pytest.mark.parametrize("names", [(), ("logs",), ("@PARAM",), ("general.json",), ("@PARAM", "param.pck")])
def test_what_it_is_made_of_stays(tree: Tree, names: Names) -> None:
    before = tree.list(())
    assert all(isinstance(outcome, FileRefusal) for outcome in changes(tree, names)[:8])
    assert tree.list(()) == before


def test_mounts_can_be_written_to(tree: Tree) -> None:
    assert tree.remove(("@MAV_LOG", "1.ulg")) is None
    assert tree.list(("logs",)) == []
    assert tree.make_folder(("d",)) is None
    assert tree.rename(("mine",), ("d", "mine")) is None
    assert tree.write(("d", "mine"), 0, b"data") is None
    assert content(tree, ("d", "mine")) == b"data"
    assert tree.rename(("d", "mine"), ("@MAV_LOG", "mine")) is FileRefusal.PROTECTED
    assert tree.truncate(("d", "mine"), 2) is None
    assert content(tree, ("d", "mine")) == b"da"
    assert tree.remove(("d", "mine")) is None
    assert tree.remove_folder(("d",)) is None
