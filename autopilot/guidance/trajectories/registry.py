"""Tracks of other packages, found as entry points."""

from importlib.metadata import entry_points
from typing import Any

from colibri.autopilot.errors import AutopilotError

GROUP = "colibri.tracks"


class TrackError(AutopilotError):
    """There is no such track, or it cannot be flown; one line says what there is."""


def installed_names() -> list[str]:
    """Return the names of the tracks of other packages."""
    return sorted({entry.name for entry in entry_points(group=GROUP)})


def load_installed(name: str) -> Any:
    """Return what another package registered as track `name`; None if none has.

    Raises:
        TrackError: It cannot be loaded.
    """
    for entry in entry_points(group=GROUP, name=name):
        try:
            return entry.load()
        except (ImportError, AttributeError) as error:
            raise TrackError(f"track {name} ({entry.value}) cannot be loaded: {error}") from error
    return None
