"""`failure.txt` in a flight's folder: the reason of an early end."""

from contextlib import suppress
from pathlib import Path
from traceback import format_exception

from colibri.common.errors import Error, ForeignError
from colibri.common.files import read_text, write_bytes

FAILURE = "failure.txt"


def keep_failure(error: Error, folder: Path | None) -> str:
    """Write the reason of a flight's end to `folder`; return the line for the user."""
    if folder is None:
        return str(error)
    path = folder / FAILURE
    line, text = failure_text(error, str(path))
    with suppress(OSError):  # a full disk, say, which then is the reason itself
        write_bytes(path, text.encode())
    return line


def failure_text(error: Error, file: str) -> tuple[str, str]:
    line, raised = str(error), ""
    if isinstance(error, ForeignError) and error.__cause__ is not None:
        line, raised = f"{line}; its traceback is in {file}", "".join(format_exception(error.__cause__))
    return line, f"{line}\n{raised}"


def kept_failure(folder: Path) -> str | None:
    try:
        return read_text(folder / FAILURE).partition("\n")[0] or None
    except (OSError, UnicodeDecodeError):
        return None
