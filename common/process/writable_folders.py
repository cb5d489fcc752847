"""Cache folders of libraries when the home is read-only."""

import os
from pathlib import Path

from colibri.common.machine_code.private_folder import private_folder


def use_writable_folders() -> None:
    if os.environ.get("MPLCONFIGDIR"):
        return
    usual = {"XDG_CONFIG_HOME": "~/.config", "XDG_CACHE_HOME": "~/.cache"}
    folders = [Path(os.environ.get(name) or os.path.expanduser(folder)) for name, folder in usual.items()]
    if all(map(_can_be_written, folders)):
        return
    folder = private_folder()
    if folder is not None:
        os.environ["MPLCONFIGDIR"] = str(folder)


def _can_be_written(folder: Path) -> bool:
    there = next(path for path in (folder, *folder.absolute().parents) if os.path.exists(path))
    return folder.is_absolute() and there.is_dir() and os.access(there, os.W_OK | os.X_OK)
