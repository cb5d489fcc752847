"""The vehicle's files as ground stations see them. Every refused operation raises `OSError` with its errno."""

from collections.abc import Callable, Iterator, Mapping
from errno import EACCES, EEXIST, EINVAL, EISDIR, ENOENT, ENOTDIR, errorcode
from typing import NamedTuple, Protocol, TypeAlias

Names: TypeAlias = tuple[str, ...]  # a path: the names of the parent folders and its own. The root is ().

MAX_NAME_BYTES = 255
MAX_DEPTH = 16
ENTRY_US = 4.0  # work to list an entry of a folder


class Entry(NamedTuple):
    name: str
    is_folder: bool
    size: int = 0  # bytes
    modified_s: int = 0  # Unix time; 0 if unknown


class OpenFile(NamedTuple):
    size: int  # bytes when opened
    read: Callable[[int, int], bytes]  # (offset, count) -> bytes, fewer at the end


class Quota(NamedTuple):
    size: int
    entries: int


class Files(Protocol):
    def list(self, names: Names) -> list[Entry]: ...

    def open(self, names: Names) -> OpenFile: ...

    def create(self, names: Names) -> None:
        """Create an empty file, or empty an existing one."""

    def write(self, names: Names, offset: int, data: bytes) -> None:
        """Write `data` into a file; a gap before it is filled with zeros."""

    def truncate(self, names: Names, size: int) -> None:
        """Keep at most the first `size` bytes of a file."""

    def remove(self, names: Names) -> None: ...

    def rename(self, old: Names, new: Names) -> None:
        """Move a file or folder; `new` must not exist."""

    def make_folder(self, names: Names) -> None: ...

    def remove_folder(self, names: Names) -> None: ...


def refused(number: int) -> OSError:
    return OSError(number, errorcode[number])


def names_of(path: str) -> Names:
    """Return the names in a path; ".." is refused."""
    names = tuple(name for name in path.split("/") if name not in ("", "."))
    if ".." in names or "\0" in path:
        raise refused(ENOENT)
    if len(names) > MAX_DEPTH or not all(map(_fits, names)):
        raise refused(EINVAL)
    return names


def entries_in(files: Files, folder: Names) -> list[Entry]:
    """Return the entries of a folder; none if it cannot be listed."""
    try:
        return files.list(folder)
    except OSError:
        return []


def can_be_new(name: str) -> bool:
    """Whether a name can be listed on any system."""
    return name not in ("", ".", "..") and name.isprintable() and "/" not in name and _fits(name)


def _fits(name: str) -> bool:
    return len(name.encode(errors="surrogatepass")) <= MAX_NAME_BYTES


Generator: TypeAlias = Callable[[str], bytes]  # returns the content for a query, the text behind a question mark


class Tree:
    """Generated (read-only) files, mounted folders, aliases, and a root for the rest, in one tree."""

    def __init__(
        self,
        root: Files,
        mounts: Mapping[str, Files],
        generated: Mapping[str, Generator],
        aliases: Mapping[str, str] | None = None,
    ) -> None:
        self._root = root
        self._mounts = {_known(path): files for path, files in mounts.items()}
        self._generated = {_known(path): generator for path, generator in generated.items()}
        self._aliases = {_known(path): _known(target) for path, target in (aliases or {}).items()}
        fixed = (*self._mounts, *self._generated, *self._aliases)
        self._folders = {names[:depth] for names in fixed for depth in range(1, len(names))}

    def list(self, names: Names) -> list[Entry]:
        if names in self._generated:
            raise refused(ENOTDIR)
        files, rest = self._at(names)
        found = entries_in(files, rest) if names in self._folders else files.list(rest)
        entries = {entry.name: entry for entry in found}
        entries |= {entry.name: entry for entry in self._fixed_in(names)}
        return [entries[name] for name in sorted(entries)]

    def open(self, names: Names) -> OpenFile:
        if names:
            name, _, query = names[-1].partition("?")
            generator = self._generated.get((*names[:-1], name))
            if generator is not None:
                data = generator(query)
                return OpenFile(len(data), lambda offset, count: data[offset : offset + count])
        if names in self._folders:
            raise refused(EISDIR)
        files, rest = self._at(names)
        return files.open(rest)

    def create(self, names: Names) -> None:
        files, rest = self._loose(names)
        files.create(rest)

    def write(self, names: Names, offset: int, data: bytes) -> None:
        files, rest = self._loose(names)
        files.write(rest, offset, data)

    def truncate(self, names: Names, size: int) -> None:
        files, rest = self._loose(names)
        files.truncate(rest, size)

    def remove(self, names: Names) -> None:
        files, rest = self._loose(names)
        files.remove(rest)

    def rename(self, old: Names, new: Names) -> None:
        files, rest = self._loose(old)
        new_files, new_rest = self._loose(new, EEXIST)
        if files is not new_files:
            raise refused(EACCES)
        files.rename(rest, new_rest)

    def make_folder(self, names: Names) -> None:
        files, rest = self._loose(names, EEXIST)
        files.make_folder(rest)

    def remove_folder(self, names: Names) -> None:
        files, rest = self._loose(names)
        files.remove_folder(rest)

    def _loose(self, names: Names, refusal: int = EACCES) -> tuple[Files, Names]:
        """Return the files that have `names`, and its path there; raise `refusal` for a fixed part of the tree."""
        fixed = (self._generated, self._mounts, self._folders, self._aliases)
        if not names or any(names in places for places in fixed):
            raise refused(refusal)
        return self._at(names)

    def _at(self, names: Names) -> tuple[Files, Names]:
        for depth in range(len(names), 0, -1):
            files = self._mounts.get(names[:depth])
            if files is not None:
                return files, names[depth:]
            target = self._aliases.get(names[:depth])
            if target is not None:
                return self._at((*target, *names[depth:]))
        return self._root, names

    def _fixed_in(self, folder: Names) -> Iterator[Entry]:
        depth = len(folder)
        for names in (*self._folders, *self._mounts, *self._aliases):
            if len(names) == depth + 1 and names[:depth] == folder:
                yield Entry(names[-1], True)
        for names, generator in self._generated.items():
            if names[:-1] == folder:
                yield Entry(names[-1], False, len(generator("")))


def _known(path: str) -> Names:
    names = names_of(path)
    if not names:
        raise ValueError(path)
    return names
