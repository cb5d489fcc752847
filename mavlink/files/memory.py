"""Files in memory, for a vehicle without a folder."""

from errno import EACCES, EEXIST, EINVAL, EISDIR, ENOENT, ENOSPC, ENOTDIR, ENOTEMPTY
from functools import partial

from colibri.mavlink.files.tree import Entry, Names, OpenFile, Quota, can_be_new, refused

DEFAULT_QUOTA = Quota(8 << 20, 1000)


class MemoryFiles:
    def __init__(self, quota: Quota = DEFAULT_QUOTA) -> None:
        self._quota = quota
        self._contents: dict[Names, bytearray | None] = {(): None}  # of files; None of folders
        self._size = 0

    def list(self, names: Names) -> list[Entry]:
        if self._content(names) is not None:
            raise refused(ENOTDIR)
        below = [(path, data) for path, data in self._contents.items() if path and path[:-1] == names]
        return sorted(Entry(path[-1], data is None, len(data or b"")) for path, data in below)

    def open(self, names: Names) -> OpenFile:
        return OpenFile(len(self._file(names)), partial(self._read, names))

    def create(self, names: Names) -> None:
        if names and names in self._contents:
            self.truncate(names, 0)
        else:
            self._add(names, bytearray())

    def write(self, names: Names, offset: int, data: bytes) -> None:
        file = self._file(names)
        more = max(offset + len(data) - len(file), 0) if data else 0
        if self._size + more > self._quota.size:
            raise refused(ENOSPC)
        self._size += more
        file.extend(bytes(more))
        file[offset : offset + len(data)] = data

    def truncate(self, names: Names, size: int) -> None:
        file = self._file(names)
        self._size -= max(len(file) - size, 0)
        del file[size:]

    def remove(self, names: Names) -> None:
        if not names:
            raise refused(EACCES)
        self._size -= len(self._file(names))
        del self._contents[names]

    def rename(self, old: Names, new: Names) -> None:
        self._look_in_parent(old)
        self._look_in_parent(new)
        self._content(old)
        self._allow_new(new)
        if new[: len(old)] == old:
            raise refused(EINVAL)
        self._contents = {_moved(path, old, new): data for path, data in self._contents.items()}

    def make_folder(self, names: Names) -> None:
        self._add(names, None)

    def remove_folder(self, names: Names) -> None:
        if not names:
            raise refused(EACCES)
        if self.list(names):
            raise refused(ENOTEMPTY)
        del self._contents[names]

    def _read(self, names: Names, offset: int, count: int) -> bytes:
        return bytes(self._file(names)[offset : offset + count])

    def _content(self, names: Names) -> bytearray | None:
        if names in self._contents:
            return self._contents[names]
        parents = (names[:depth] for depth in range(1, len(names)))
        raise refused(ENOTDIR if any(self._contents.get(parent) is not None for parent in parents) else ENOENT)

    def _file(self, names: Names) -> bytearray:
        content = self._content(names)
        if content is None:
            raise refused(EISDIR)
        return content

    def _look_in_parent(self, names: Names) -> None:
        if not names:
            raise refused(EACCES)
        if self._content(names[:-1]) is not None:
            raise refused(ENOTDIR)

    def _allow_new(self, names: Names) -> None:
        self._look_in_parent(names)
        if names in self._contents:
            raise refused(EEXIST)
        if not can_be_new(names[-1]):
            raise refused(EINVAL)

    def _add(self, names: Names, content: bytearray | None) -> None:
        self._allow_new(names)
        if len(self._contents) > self._quota.entries:  # the root is no entry
            raise refused(ENOSPC)
        self._contents[names] = content


def _moved(path: Names, old: Names, new: Names) -> Names:
    return new + path[len(old) :] if path[: len(old)] == old else path
