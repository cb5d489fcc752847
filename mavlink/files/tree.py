"""The vehicle's files as ground stations see them. Invalid input is refused; these classes never raise."""

from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from errno import EACCES, EEXIST, EINVAL, EIO, EISDIR, ENOENT, ENOSPC, ENOTDIR, ENOTEMPTY
from typing import NamedTuple, Protocol, TypeAlias

Names: TypeAlias = tuple[str, ...]  # a path: the names of the parent folders and its own. The root is ().

MAX_NAME_BYTES = 255
MAX_DEPTH = 16
ENTRY_US = 4.0  # work to list an entry of a folder


class FileRefusal(Enum):
    """Reason why an operation was refused, as an errno."""

    NOT_FOUND = ENOENT
    EXISTS = EEXIST
    PROTECTED = EACCES
    NO_SPACE = ENOSPC
    IS_FOLDER = EISDIR
    NOT_A_FOLDER = ENOTDIR
    NOT_EMPTY = ENOTEMPTY
    BAD_NAME = EINVAL
    FAILED = EIO


class Entry(NamedTuple):
    name: str
    is_folder: bool
    size: int = 0  # bytes
    modified_s: int = 0  # Unix time; 0 if unknown


class OpenFile(NamedTuple):
    size: int  # bytes when opened
    read: Callable[[int, int], bytes | FileRefusal]  # (offset, count) -> bytes, fewer at the end


class Quota(NamedTuple):
    size: int
    entries: int


class Files(Protocol):
    def list(self, names: Names) -> list[Entry] | FileRefusal: ...

    def open(self, names: Names) -> OpenFile | FileRefusal: ...

    def create(self, names: Names) -> FileRefusal | None:
        """Create an empty file, or empty an existing one."""

    def write(self, names: Names, offset: int, data: bytes) -> FileRefusal | None:
        """Write `data` into a file; a gap before it is filled with zeros."""

    def truncate(self, names: Names, size: int) -> FileRefusal | None:
        """Keep at most the first `size` bytes of a file."""

    def remove(self, names: Names) -> FileRefusal | None: ...

    def rename(self, old: Names, new: Names) -> FileRefusal | None:
        """Move a file or folder; `new` must not exist."""

    def make_folder(self, names: Names) -> FileRefusal | None: ...

    def remove_folder(self, names: Names) -> FileRefusal | None: ...


def names_of(path: str) -> Names | FileRefusal:
    """Return the names in a path; ".." is refused."""
    names = tuple(name for name in path.split("/") if name not in ("", "."))
    if ".." in names or "\0" in path:
        return FileRefusal.NOT_FOUND
    if len(names) > MAX_DEPTH or not all(map(_fits, names)):
        return FileRefusal.BAD_NAME
    return names


def can_be_new(name: str) -> bool:
    """Whether a name can be listed on any system."""
    return name not in ("", ".", "..") and name.isprintable() and "/" not in name and _fits(name)


def _fits(name: str) -> bool:
    return len(name.encode(errors="surrogatepass")) <= MAX_NAME_BYTES


def reading_of(data: bytes) -> OpenFile:
    return OpenFile(len(data), lambda offset, count: data[offset : offset + count])


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

    def list(self, names: Names) -> list[Entry] | FileRefusal:
        if names in self._generated:
            return FileRefusal.NOT_A_FOLDER
        files, rest = self._at(names)
        found = files.list(rest)
        if isinstance(found, FileRefusal):
            if names not in self._folders:
                return found
            found = []
        entries = {entry.name: entry for entry in found}
        entries |= {entry.name: entry for entry in self._fixed_in(names)}
        return [entries[name] for name in sorted(entries)]

    def open(self, names: Names) -> OpenFile | FileRefusal:
        if names:
            name, _, query = names[-1].partition("?")
            generator = self._generated.get((*names[:-1], name))
            if generator is not None:
                return reading_of(generator(query))
        if names in self._folders:
            return FileRefusal.IS_FOLDER
        files, rest = self._at(names)
        return files.open(rest)

    def create(self, names: Names) -> FileRefusal | None:
        return self._change(names, lambda files, rest: files.create(rest))

    def write(self, names: Names, offset: int, data: bytes) -> FileRefusal | None:
        return self._change(names, lambda files, rest: files.write(rest, offset, data))

    def truncate(self, names: Names, size: int) -> FileRefusal | None:
        return self._change(names, lambda files, rest: files.truncate(rest, size))

    def remove(self, names: Names) -> FileRefusal | None:
        return self._change(names, lambda files, rest: files.remove(rest))

    def rename(self, old: Names, new: Names) -> FileRefusal | None:
        if self._is_fixed(old):
            return FileRefusal.PROTECTED
        if self._is_fixed(new):
            return FileRefusal.EXISTS
        files, rest = self._at(old)
        new_files, new_rest = self._at(new)
        return files.rename(rest, new_rest) if files is new_files else FileRefusal.PROTECTED

    def make_folder(self, names: Names) -> FileRefusal | None:
        if self._is_fixed(names):
            return FileRefusal.EXISTS
        files, rest = self._at(names)
        return files.make_folder(rest)

    def remove_folder(self, names: Names) -> FileRefusal | None:
        return self._change(names, lambda files, rest: files.remove_folder(rest))

    def _change(self, names: Names, change: Callable[[Files, Names], FileRefusal | None]) -> FileRefusal | None:
        return FileRefusal.PROTECTED if self._is_fixed(names) else change(*self._at(names))

    def _is_fixed(self, names: Names) -> bool:
        fixed = (self._generated, self._mounts, self._folders, self._aliases)
        return not names or any(names in places for places in fixed)

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
    if isinstance(names, FileRefusal) or not names:
        raise ValueError(path)
    return names
