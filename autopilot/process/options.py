"""Options of an autopilot's command line that whatever starts one has, too."""

from argparse import ArgumentTypeError
from collections.abc import Callable

from colibri.common.process.arguments import number

MAX_DELAY_MS = 200.0


def delay(text: str) -> float:
    """Read a delay of the command line, ms."""
    value = number(text)
    if not 0.0 <= value <= MAX_DELAY_MS:
        raise ArgumentTypeError(f"must be 0 to {MAX_DELAY_MS:g} ms, not {text}")
    return value


def add_delay(add: Callable[..., object]) -> None:
    """Add the delay that is compensated."""
    add(
        "--delay",
        type=delay,
        metavar="MS",
        help="compensate this delay from a frame until its command takes effect; 0: none (default: the profile's, or "
        "the one that the plant measures)",
    )


def delay_s(delay_ms: float | None) -> float | None:
    """Return a delay in seconds, as `Profile.with_choices` takes it."""
    return None if delay_ms is None else delay_ms * 1e-3
