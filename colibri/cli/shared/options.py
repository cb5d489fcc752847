"""Options that several subcommands share."""

from collections.abc import Callable
from pathlib import Path

from colibri.mavlink.hil.feedback import Feedback, feedback


def add_feedback(add: Callable[..., object]) -> None:
    """Add what the autopilot flies by."""
    add(
        "--feedback",
        type=feedback,
        default=Feedback.STATE,
        metavar="state|sensors",
        help="what the autopilot flies by: the true state (default), or what sensors measure",
    )


def add_signing(add: Callable[..., object]) -> None:
    """Add the key of links, and leave to do without."""
    add("--signing-key", type=Path, metavar="FILE", help="sign what is sent, refuse what is not signed with this key")
    add("--insecure", action="store_true", help="let links leave this computer without a key")


def add_out(add: Callable[..., object], folder: str, what: str) -> None:
    """Add the folder that takes `what`, `folder` where it is not named, and leave to be quiet."""
    add("--out", type=Path, default=Path(folder), metavar="DIR", help=f"folder for {what} (default %(default)s)")
    add("--quiet", action="store_true", help="say nothing but errors")
