"""Files in a folder on disk, walked name by name without following links: files outside are unreachable."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EACCES, EEXIST, EINVAL, EISDIR, ENOENT, ENOSPC
from functools import partial
from pathlib import Path

from colibri.mavlink.files.tree import Entry, Names, OpenFile, Quota, can_be_new, refused

DEFAULT_QUOTA = Quota(64 << 20, 1000)

_SAFELY = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK  # follow no link; do not block on a pipe
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | _SAFELY


class Folder:
    """Files in a folder on disk, without other writers."""

    def __init__(self, path: Path, quota: Quota = DEFAULT_QUOTA) -> None:
        path.mkdir(parents=True, exist_ok=True)
        self._quota = quota
        self._root = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        self._size, self._entries = self._measure()

    def close(self) -> None:
        os.close(self._root)

    def list(self, names: Names) -> list[Entry]:
        with self._open_folder(names) as folder, os.scandir(folder) as found:
            return sorted(entry for entry in map(_entry_of, found) if entry is not None)

    def open(self, names: Names) -> OpenFile:
        with self._open_file(names, os.O_RDONLY) as file:
            return OpenFile(os.fstat(file).st_size, partial(self._read, names))

    def create(self, names: Names) -> None:
        with self._open_parent(names) as (folder, name):
            if _kind(folder, name) is None:
                self._allow_new(name)
                os.close(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _SAFELY, 0o644, dir_fd=folder))
                self._entries += 1
                return
        self.truncate(names, 0)

    def write(self, names: Names, offset: int, data: bytes) -> None:
        with self._open_file(names, os.O_WRONLY) as file:
            more = max(offset + len(data) - os.fstat(file).st_size, 0) if data else 0
            if self._size + more > self._quota.size or os.pwrite(file, data, offset) != len(data):
                raise refused(ENOSPC)
            self._size += more

    def truncate(self, names: Names, size: int) -> None:
        with self._open_file(names, os.O_WRONLY) as file:
            gone = os.fstat(file).st_size - size
            if gone > 0:
                os.ftruncate(file, size)
                self._size -= gone

    def remove(self, names: Names) -> None:
        with self._open_parent(names) as (folder, name):
            status = self._existing(folder, name)
            if stat.S_ISDIR(status.st_mode):
                raise refused(EISDIR)
            os.unlink(name, dir_fd=folder)
            self._size -= status.st_size
            self._entries -= 1

    def rename(self, old: Names, new: Names) -> None:
        with self._open_parent(old) as (old_folder, old_name), self._open_parent(new) as (new_folder, new_name):
            self._existing(old_folder, old_name)
            if _kind(new_folder, new_name) is not None:
                raise refused(EEXIST)
            if not can_be_new(new_name):
                raise refused(EINVAL)
            os.rename(old_name, new_name, src_dir_fd=old_folder, dst_dir_fd=new_folder)

    def make_folder(self, names: Names) -> None:
        with self._open_parent(names) as (folder, name):
            if _kind(folder, name) is not None:
                raise refused(EEXIST)
            self._allow_new(name)
            os.mkdir(name, 0o755, dir_fd=folder)
            self._entries += 1

    def remove_folder(self, names: Names) -> None:
        with self._open_parent(names) as (folder, name):
            os.rmdir(name, dir_fd=folder)
            self._entries -= 1

    def _read(self, names: Names, offset: int, count: int) -> bytes:
        with self._open_file(names, os.O_RDONLY) as file:
            return os.pread(file, count, offset)

    def _allow_new(self, name: str) -> None:
        if not can_be_new(name):
            raise refused(EINVAL)
        if self._entries >= self._quota.entries:
            raise refused(ENOSPC)

    def _existing(self, folder: int, name: str) -> os.stat_result:
        status = os.stat(name, dir_fd=folder, follow_symlinks=False)
        if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
            raise refused(ENOENT)
        return status

    @contextmanager
    def _open_folder(self, names: Names) -> Iterator[int]:
        folder = os.open(".", _FOLDER, dir_fd=self._root)
        try:
            for name in names:
                below = os.open(_plain(name), _FOLDER, dir_fd=folder)
                os.close(folder)
                folder = below
            yield folder
        finally:
            os.close(folder)

    @contextmanager
    def _open_parent(self, names: Names) -> Iterator[tuple[int, str]]:
        if not names:
            raise refused(EACCES)
        with self._open_folder(names[:-1]) as folder:
            yield folder, _plain(names[-1])

    @contextmanager
    def _open_file(self, names: Names, how: int) -> Iterator[int]:
        if not names:
            raise refused(EISDIR)
        with self._open_folder(names[:-1]) as folder:
            name = _plain(names[-1])
            if stat.S_ISDIR(self._existing(folder, name).st_mode):
                raise refused(EISDIR)
            file = os.open(name, how | _SAFELY, dir_fd=folder)
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise refused(ENOENT)
            yield file
        finally:
            os.close(file)

    def _measure(self) -> tuple[int, int]:
        size = entries = 0
        for _, folders, files, folder in os.fwalk(".", dir_fd=self._root):
            entries += len(folders) + len(files)
            size += sum(os.stat(name, dir_fd=folder, follow_symlinks=False).st_size for name in files)
        return size, entries


def _plain(name: str) -> str:
    if name in ("", ".", "..") or "/" in name or "\0" in name:
        raise refused(ENOENT)
    return name


def _kind(folder: int, name: str) -> int | None:
    try:
        return os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode
    except FileNotFoundError:
        return None


def _entry_of(found: os.DirEntry[str]) -> Entry | None:
    try:
        status = found.stat(follow_symlinks=False)
    except OSError:
        return None
    if stat.S_ISDIR(status.st_mode):
        return Entry(found.name, True, 0, max(int(status.st_mtime), 0))
    if stat.S_ISREG(status.st_mode):
        return Entry(found.name, False, status.st_size, max(int(status.st_mtime), 0))
    return None
