"""Arguments of environments: numbers, gates, draws; refused in one line."""

from argparse import ArgumentTypeError
from collections.abc import Mapping
from pathlib import Path, PurePath
from types import NoneType
from typing import Any

import numpy as np

from colibri.autopilot.guidance.trajectories.waypoint_file import read_waypoints
from colibri.campaigns.factors import CampaignError, Draw, is_number, read_draw
from colibri.common.errors import Error, checked, shown, unknown
from colibri.common.matrices import norm
from colibri.common.types import Array
from colibri.plant.environment.weather import Wind
from colibri.plant.physics.start import Start
from colibri.plant.texts import wind as read_wind


class GymError(Error):
    """An environment cannot be made or stepped as requested."""


class GymImportError(GymError, ImportError):
    """A package of the extra `gym` is missing."""


def gate_points(given: Any) -> Array:
    """Return start and gates, ENU, (n, 3), of a waypoint file or an array."""
    if isinstance(given, str | PurePath):
        return read_waypoints(Path(given)).points_enu_m
    try:
        points = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        points = np.empty(0)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 2 or not np.isfinite(points).all():
        raise GymError(f'gates must be a waypoint file, or points (n, 3) in m from the start on, not "{shown(given)}"')
    if (np.diff(points, axis=0) == 0.0).all(axis=1).any():
        raise GymError("gates: two points in a row are the same")
    return points


def gates_of(points: Array, preview: int) -> Array:
    """Return the gates of `judge_race`; each points from the one before to the next."""
    legs = np.diff(points, axis=0)
    ways = legs.copy()
    ways[:-1] += legs[1:]
    back = (ways == 0.0).all(axis=1)
    ways[back] = legs[back]
    lengths = [[norm(leg)] for leg in legs]
    units = np.array([way / norm(way) for way in ways])
    gates = np.hstack([points[1:], units, lengths])
    return np.vstack([gates, np.tile((*points[-1], *units[-1], 0.0), (preview + 1, 1))])


def read_draws(usual: Mapping[str, Any], own: Mapping[str, Any] | None) -> tuple[dict[str, Any], dict[str, Draw]]:
    """Return fixed values and distributions by key, in alphabetical order; `own` keys replace `usual` ones."""
    checked("draw", own, (Mapping, NoneType), "a table of keys", GymError)
    given = {**usual, **(own or {})}
    known = ("wind", "lost", "vehicle.body.mass_kg", *(f"start.{key}" for key in Start._fields))
    fixed: dict[str, Any] = {}
    draws: dict[str, Draw] = {}
    for key in sorted(map(str, given)):
        if key not in known and not key.startswith("vehicle."):
            raise GymError(unknown("key of draw", key, known))
        value = given[key]
        try:
            if isinstance(value, Mapping):
                draws[key] = read_draw(f"draw: {key}", value)
            else:
                fixed[key] = value
        except CampaignError as error:
            raise GymError(str(error)) from None
    starts = [(key, each) for key in draws if key.startswith("start.") for each in draws[key].typical]
    for key, value in (*starts, *((key, value) for key, value in fixed.items() if key.startswith("start."))):
        if not is_number(value):
            raise GymError(f'draw: {key} must be a number, not "{shown(value)}"')
    return fixed, draws


def wind_of(given: Any) -> Wind:
    try:
        wind = given if isinstance(given, Wind) else read_wind(str(given))
    except ArgumentTypeError as error:
        raise GymError(f"draw: wind: {error}") from None
    if not isinstance(wind, Wind):
        raise GymError(f'draw: wind must be constant, for example "5@270", not a file "{shown(given)}"')
    return wind


def within(name: str, given: Any, least: float, most: float, unit: str) -> None:
    if not is_number(given) or not least <= given <= most:
        raise GymError(f'{name} must be a number from {least:g} to {most:g} {unit}, not "{shown(given)}"')
