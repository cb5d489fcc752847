"""Files in memory, for a vehicle without a folder."""

from functools import partial

from colibri.mavlink.files.tree import Entry, FileRefusal, Names, OpenFile, Quota, can_be_new

DEFAULT_QUOTA = Quota(8 << 20, 1000)


class MemoryFiles:
    def __init__(self, quota: Quota = DEFAULT_QUOTA) -> None:
        self._quota = quota
        self._files: dict[Names, bytearray] = {}
        self._folders: set[Names] = {()}
        self._size = 0

    def list(self, names: Names) -> list[Entry] | FileRefusal:
        if names not in self._folders:
            return self._no_way(names) or (FileRefusal.NOT_A_FOLDER if names in self._files else FileRefusal.NOT_FOUND)
        found = [Entry(path[-1], True) for path in self._folders if path and path[:-1] == names]
        found += [Entry(path[-1], False, len(data)) for path, data in self._files.items() if path[:-1] == names]
        return sorted(found)

    def open(self, names: Names) -> OpenFile | FileRefusal:
        return self._no_file(names) or OpenFile(len(self._files[names]), partial(self._read, names))

    def create(self, names: Names) -> FileRefusal | None:
        if names in self._files:
            return self.truncate(names, 0)
        refusal = self._no_room(names)
        if refusal is None:
            self._files[names] = bytearray()
        return FileRefusal.IS_FOLDER if refusal is FileRefusal.EXISTS else refusal

    def write(self, names: Names, offset: int, data: bytes) -> FileRefusal | None:
        refusal = self._no_file(names)
        if refusal is not None:
            return refusal
        file = self._files[names]
        more = max(offset + len(data) - len(file), 0) if data else 0
        if self._size + more > self._quota.size:
            return FileRefusal.NO_SPACE
        self._size += more
        file.extend(bytes(more))
        file[offset : offset + len(data)] = data
        return None

    def truncate(self, names: Names, size: int) -> FileRefusal | None:
        refusal = self._no_file(names)
        if refusal is None:
            self._size -= max(len(self._files[names]) - size, 0)
            del self._files[names][size:]
        return refusal

    def remove(self, names: Names) -> FileRefusal | None:
        refusal = self._no_file(names) if names else FileRefusal.PROTECTED
        if refusal is None:
            self._size -= len(self._files.pop(names))
        return refusal

    def rename(self, old: Names, new: Names) -> FileRefusal | None:
        old_refusal = self._no_way(old) if old else FileRefusal.PROTECTED
        refusal = old_refusal or (self._no_way(new) if new else FileRefusal.PROTECTED)
        if refusal is None and old not in self._files and old not in self._folders:
            refusal = FileRefusal.NOT_FOUND
        refusal = refusal or self._no_place(new) or (FileRefusal.BAD_NAME if new[: len(old)] == old else None)
        if refusal is None:
            self._files = {_moved(path, old, new): data for path, data in self._files.items()}
            self._folders = {_moved(path, old, new) for path in self._folders}
        return refusal

    def make_folder(self, names: Names) -> FileRefusal | None:
        refusal = self._no_room(names)
        if refusal is None:
            self._folders.add(names)
        return refusal

    def remove_folder(self, names: Names) -> FileRefusal | None:
        if not names:
            return FileRefusal.PROTECTED
        found = self.list(names)
        if isinstance(found, FileRefusal):
            return found
        if found:
            return FileRefusal.NOT_EMPTY
        self._folders.remove(names)
        return None

    def _read(self, names: Names, offset: int, count: int) -> bytes | FileRefusal:
        return self._no_file(names) or bytes(self._files[names][offset : offset + count])

    def _no_way(self, names: Names) -> FileRefusal | None:
        for depth in range(1, len(names)):
            if names[:depth] not in self._folders:
                return FileRefusal.NOT_A_FOLDER if names[:depth] in self._files else FileRefusal.NOT_FOUND
        return None

    def _no_file(self, names: Names) -> FileRefusal | None:
        if names in self._files:
            return None
        if names in self._folders:
            return FileRefusal.IS_FOLDER
        return self._no_way(names) or FileRefusal.NOT_FOUND

    def _no_place(self, names: Names) -> FileRefusal | None:
        if not names:
            return FileRefusal.PROTECTED
        if names in self._files or names in self._folders:
            return FileRefusal.EXISTS
        return self._no_way(names) or (None if can_be_new(names[-1]) else FileRefusal.BAD_NAME)

    def _no_room(self, names: Names) -> FileRefusal | None:
        full = len(self._files) + len(self._folders) > self._quota.entries  # the root is no entry
        return self._no_place(names) or (FileRefusal.NO_SPACE if full else None)


def _moved(path: Names, old: Names, new: Names) -> Names:
    return new + path[len(old) :] if path[: len(old)] == old else path
