"""Tracks checked and adapted for one vehicle."""

from math import inf
from pathlib import Path
from typing import NamedTuple

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.guidance.trajectories.csv_table import TrackFileError
from colibri.autopilot.guidance.trajectories.fitting import dips_of, fit
from colibri.autopilot.guidance.trajectories.reach import Reach, exact_motion
from colibri.autopilot.guidance.trajectories.registry import TrackError, read_options, track
from colibri.autopilot.guidance.trajectories.time_optimal.fastest import fastest
from colibri.autopilot.guidance.trajectories.tracks import DURATION_S, OPTIONS, FileOptions, Track
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints
from colibri.autopilot.spec import Trajectory
from colibri.common.files import read_given
from colibri.plant.vehicle.description import Vehicle


class LoadedTrack(NamedTuple):
    track: Track
    note: str


def load_track(
    given: str | Trajectory, vehicle: Vehicle, profile: Profile, floor_m: float | None = None, text: str | None = None
) -> LoadedTrack:
    """Load a track for a vehicle; waypoint tracks are adapted to its limits, others are flown unchanged.

    A TrackError is raised if it is unknown, infeasible, or below the floor, m, ENU, by default the ground. `text`
    replaces the content of the track's file.
    """
    name = str(given)
    found = track(name, given.text if isinstance(given, Trajectory) else text)
    if found.waypoints is not None:
        return track_through(found.waypoints, vehicle, profile, floor_m)
    reach, floor = Reach(vehicle, profile, exact_drag=False), _floor(vehicle, floor_m)
    for time_s, height_m in dips_of(found, floor):
        raise TrackError(f"track {name} is at {height_m:.2f} m after {time_s:.2f} s, below the floor of {floor:g} m")
    demands = reach.demands(exact_motion(found), reach.charge_of_hover(min(found.duration_s, DURATION_S)))
    beyond = [str(demand) for demand in demands if demand.excess(0.0).max() > 1.0]
    notes = [f"track {name} exceeds the limits: {'; '.join(beyond)}"] if beyond else []
    return LoadedTrack(found, "; ".join(filter(None, (getattr(given, "note", found.note), *notes))))


def track_through(
    waypoints: Waypoints, vehicle: Vehicle, profile: Profile, floor_m: float | None = None
) -> LoadedTrack:
    """Return the track through waypoints, adapted as in `load_track`."""
    reach = Reach(vehicle, profile, exact_drag=waypoints.fastest)
    try:
        fitted, changed = (fastest if waypoints.fastest else fit)(waypoints, reach, _floor(vehicle, floor_m))
    except TrackFileError as error:
        raise TrackError(str(error)) from error
    return LoadedTrack(fitted, f"{waypoints.path}: {changed}" if changed else "")


def _floor(vehicle: Vehicle, floor_m: float | None) -> float:
    return (-inf if vehicle.ground is None else 0.0) if floor_m is None else floor_m


def file_text(name: str | Trajectory) -> str | None:
    """Return the content of a track's file, or its samples, if it has any."""
    if isinstance(name, Trajectory):
        return name.text
    path = file_of(name)
    return None if path is None else read_given(Path(path), TrackError)


def with_file(name: str, path: Path) -> str:
    given = file_of(name)
    return name if given is None else name.replace(given, str(path), 1)


def file_of(name: str) -> str | None:
    base, colon, text = name.partition(":")
    options = read_options(base, OPTIONS[base], text) if colon and base in OPTIONS else None
    return options.file if isinstance(options, FileOptions) else None
