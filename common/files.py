"""Files opened without waiting: a FIFO, device or socket is an error."""

import os
import stat
from errno import EINVAL, EISDIR, ENXIO
from pathlib import Path

_NOT_REGULAR = "is a FIFO, device or socket: a regular file is required"


def regular(path: str, flags: int, mode: int = 0o666) -> int:
    """Open a regular file, as `opener` of `open`; OSError for anything else."""
    try:
        file = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC, mode)
    except OSError as error:
        if error.errno != ENXIO:  # a FIFO without a reader
            raise
        raise OSError(EINVAL, _NOT_REGULAR, path) from None
    kind = os.fstat(file).st_mode
    if not stat.S_ISREG(kind):
        os.close(file)
        raise (
            IsADirectoryError(EISDIR, os.strerror(EISDIR), path)
            if stat.S_ISDIR(kind)
            else OSError(EINVAL, _NOT_REGULAR, path)
        )
    return file


def private(path: str, flags: int) -> int:
    """Open a regular file; create it for its owner only."""
    return regular(path, flags, 0o600)


def read_bytes(path: Path) -> bytes:
    with open(path, "rb", opener=regular) as file:
        return file.read()


def read_with_mode(path: Path) -> tuple[bytes, int]:
    """Return the content and the permissions of a file; without permissions, those of its owner only."""
    with open(path, "rb", opener=regular) as file:
        mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode) if os.name == "posix" else 0o600
        return file.read(), mode


def read_text(path: Path, encoding: str = "utf-8") -> str:
    with open(path, encoding=encoding, opener=regular) as file:
        return file.read()


def read_given(path: Path, raises: type[Exception]) -> str:
    """Read a text file of the user, with or without byte order mark, or raise `raises`."""
    try:
        return read_text(path, "utf-8-sig")
    except (OSError, ValueError) as error:
        raise raises(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def write_bytes(path: Path, content: bytes) -> None:
    with open(path, "wb", opener=regular) as file:
        file.write(content)
