"""A private temporary folder, the fallback if all other folders are read-only."""

import os
from pathlib import Path
from stat import S_ISDIR
from tempfile import gettempdir


def private_folder() -> Path | None:
    """Return this user's temporary folder, created if missing; `None` if impossible.

    Code in it is executed, so the folder must belong to this user and be writable by this user only.
    """
    try:
        folder = Path(gettempdir()) / f"colibri-{os.getuid()}"
        folder.mkdir(0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return None
    private = S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return folder if private else None
