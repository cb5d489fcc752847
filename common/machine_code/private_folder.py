"""A private temporary folder, for read-only homes."""

import os
from pathlib import Path
from stat import S_ISDIR
from tempfile import gettempdir


def private_folder() -> Path | None:
    """Return this user's temporary folder, if only the user may write to it: its code is executed."""
    try:
        folder = Path(gettempdir()) / f"colibri-{os.getuid()}"
        folder.mkdir(0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return None
    private = S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return folder if private else None
