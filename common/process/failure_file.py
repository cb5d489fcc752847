"""`failure.txt` in the folder of a flight: why it came to an early end, and the traceback where foreign code raised."""

from contextlib import suppress
from pathlib import Path
from traceback import format_exception

from colibri.common.errors import Error, ForeignError

FAILURE = "failure.txt"


def keep_failure(error: Error, folder: Path | None) -> str:
    """Write why a flight has ended to `folder`, if there is one; return the line that a user needs."""
    line, raised = str(error), ""
    if folder is None:
        return line
    path = folder / FAILURE
    if isinstance(error, ForeignError) and error.__cause__ is not None:
        line, raised = f"{line}; its traceback is in {path}", "".join(format_exception(error.__cause__))
    with suppress(OSError):  # a full disk, say, which then is the reason itself
        path.write_text(f"{line}\n{raised}", encoding="utf-8")
    return line


def kept_failure(folder: Path) -> str | None:
    """Return why the flight in `folder` has ended early; None where it has not, or where nobody could say."""
    try:
        return (folder / FAILURE).read_text(encoding="utf-8").partition("\n")[0] or None
    except (OSError, UnicodeDecodeError):
        return None
