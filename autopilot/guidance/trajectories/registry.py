"""Tracks by name: Colibri's own, and entry points."""

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import entry_points
from math import isfinite
from typing import Any, Literal, get_args, get_origin

import msgspec
import numpy as np

from colibri.autopilot.errors import AutopilotError
from colibri.autopilot.guidance.trajectories.csv_table import TrackFileError
from colibri.autopilot.guidance.trajectories.taylor import in_series
from colibri.autopilot.guidance.trajectories.tracks import OPTIONS, THESIS_TRACKS, FileOptions, Track, TrackOptions
from colibri.common.errors import Error, checked, unknown

GROUP = "colibri.tracks"


class TrackError(AutopilotError):
    """Unknown or infeasible track; the message lists the choices."""


def track(name: str, text: str | None = None) -> Track:
    """Return the track of a name, `NAME[:KEY=VALUE[,KEY=VALUE…]]`; `text` replaces the content of its file.

    Raises:
        TrackError: The track or an option is unknown, a value is impossible, or the file cannot be flown.
    """
    checked("track", name, str, "a name", TrackError)
    base, colon, given = name.partition(":")
    if base in THESIS_TRACKS and not colon:
        return THESIS_TRACKS[base]
    if base in THESIS_TRACKS:
        raise TrackError(f"track {base} takes no options, but these do: {', '.join(OPTIONS)}")
    if base in OPTIONS:
        options = read_options(base, OPTIONS[base], given if colon else None)
        try:
            return options.track_of(text) if isinstance(options, FileOptions) else options.track()
        except TrackFileError as error:
            raise TrackError(str(error)) from error
    kind = _load_installed(base)
    if kind is None:
        raise TrackError(unknown("track", base, track_names()))
    if not (isinstance(kind, type) and issubclass(kind, TrackOptions)):
        raise TrackError(f"track {base}: {kind} is not a subclass of colibri.TrackOptions")
    return tried(base, read_options(base, kind, given if colon else None).track, kind.__name__)


def track_names() -> list[str]:
    """Return the names of all tracks: built-in, then from other packages."""
    own = [*THESIS_TRACKS, *OPTIONS]
    return own + sorted({entry.name for entry in entry_points(group=GROUP)}.difference(own))


def _load_installed(name: str) -> Any:
    for entry in entry_points(group=GROUP, name=name):
        try:
            return entry.load()
        except (ImportError, AttributeError) as error:
            raise TrackError(f"track {name} ({entry.value}) cannot be loaded: {error}") from error
    return None


def tried(name: str, make: Callable[[], Track], kind: str) -> Track:
    """Return the track of a user's options, checked for finite coordinates at the start."""
    try:
        given = make()
        found = replace(given, position=in_series(given.position), yaw=given.yaw and in_series(given.yaw))
        start = found.clock(np.zeros(1), 1)
        starts = [axis.derivative(0).item() for axis in found.position(start)]
        yaw_rad = 0.0 if found.yaw is None else found.yaw(start).derivative(0).item()
    except Error:
        raise
    except Exception as error:
        raise TrackError(f"track {name}: {kind}: {type(error).__name__}: {error}") from error
    if len(starts) != 3 or not all(map(isfinite, (*starts, yaw_rad))):
        raise TrackError(f"track {name}: {kind} gives no colibri.Track of three finite coordinates")
    return found


def read_options(name: str, kind: type[TrackOptions], text: str | None) -> TrackOptions:
    fields = {field.name: field for field in msgspec.structs.fields(kind)}
    given = _pairs(name, kind, text)
    for key in given:
        if key not in fields:
            raise TrackError(f"track {name}: {unknown('option', key, fields)}")
    for key, field in fields.items():
        if field.required and key not in given:
            raise TrackError(f"track {name} needs {key}: {name}:{key}={key.upper()}")
    try:
        return msgspec.convert(given, type=kind, strict=False)
    except msgspec.ValidationError as reason:
        raise TrackError(f"track {name}: {_explained(str(reason), fields, given)}") from reason


def _pairs(name: str, kind: type[TrackOptions], text: str | None) -> dict[str, str]:
    given: dict[str, str] = {}
    for number, item in enumerate([] if text is None else text.split(",")):
        key, equals, value = item.partition("=")
        if not equals and item and number == 0 and kind.lone:
            key, equals, value = kind.lone, "=", item
        if not equals or not key or not value:
            choices = ", ".join(kind.__struct_fields__)
            raise TrackError(f"track {name}: options are KEY=VALUE[,KEY=VALUE…], not {text!r}: choose {choices}")
        if key in given:
            raise TrackError(f"track {name}: {key} is given twice")
        given[key] = value
    return given


def _explained(reason: str, fields: dict[str, msgspec.structs.FieldInfo], given: dict[str, str]) -> str:
    what, _, key = reason.rstrip("`").partition(" - at `$.")
    if key not in fields:
        return what
    kinds = (fields[key].type, *get_args(fields[key].type))
    words = [word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)]
    if what.startswith("Invalid enum value"):
        what = f"choose {', '.join(words)}{'' if get_origin(fields[key].type) is Literal else ', or a number'}"
    return f"{key}={given[key]}: {what}"
