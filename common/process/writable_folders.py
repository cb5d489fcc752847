"""Cache folders of libraries when the home is read-only."""

import os
from pathlib import Path

from colibri.common.machine_code.private_folder import private_folder


def use_writable_folders() -> None:
    if os.environ.get("MPLCONFIGDIR"):
        return
    try:
        home = [Path.home() / ".config", Path.home() / ".cache"]
    except RuntimeError:  # there is none
        home = []
    named = [os.environ.get("XDG_CONFIG_HOME"), os.environ.get("XDG_CACHE_HOME")]
    folders = [Path(name) if name else folder for name, folder in zip(named, home, strict=False)]
    if folders and all(map(_can_be_written, folders)):
        return
    folder = private_folder()
    if folder is not None:
        os.environ["MPLCONFIGDIR"] = str(folder)


def _can_be_written(folder: Path) -> bool:
    there = next(path for path in (folder, *folder.absolute().parents) if os.path.exists(path))
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)
