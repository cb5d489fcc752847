"""A temporary folder of this user's, where nothing else can be written to."""

import os
from pathlib import Path
from stat import S_ISDIR
from tempfile import gettempdir


def private_folder() -> Path | None:
    """Return a temporary folder of this user's, made where it is missing; None where it cannot be.

    What is kept there is run: nobody else may own the folder or write to it.
    """
    try:
        folder = Path(gettempdir()) / f"colibri-{os.getuid()}"
        folder.mkdir(0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return None
    private = S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return folder if private else None
