"""Tracks given as objects and functions of time, sampled."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from typing import Any

import numpy as np

from colibri.autopilot.guidance.trajectories.csv_table import MAX_DURATION_S
from colibri.autopilot.guidance.trajectories.registry import TrackError, tried
from colibri.autopilot.guidance.trajectories.samples_file import columns_of, local_fit
from colibri.autopilot.guidance.trajectories.taylor import in_series
from colibri.autopilot.guidance.trajectories.tracks import Track, TrackOptions, position
from colibri.autopilot.spec import Trajectory
from colibri.common.types import Array

_STEP_S, _MAX_SAMPLES = 0.02, 20_000
_BEYOND_S = 2.0  # sampled beyond the end of a flight, as its control law looks ahead
_NEIGHBOURS = 7
_NAMES = ("position", "velocity", "acceleration", "yaw")
_OTHERS = {"position": "x", "velocity": "x_dot", "acceleration": "x_ddot"}  # the names of RotorPy
_EXPECTED = (
    "expected a function of time that returns x, y, z (m, ENU), or position, velocity and acceleration; "
    "or an object with such a function position, and velocity, acceleration and yaw (rad) if it has them"
)
Motion = dict[str, Array]


def sampled_track(given: Any, duration_s: float) -> Trajectory:
    """Sample a `colibri.Track`, its options, a function or an object; TrackError if it is none of these."""
    name = str(getattr(given, "__name__", type(given).__name__)).strip("<>")
    flown = given() if isinstance(given, type) and issubclass(given, TrackOptions) else given
    if isinstance(flown, Track | TrackOptions):
        flown = tried(name, partial(replace, flown) if isinstance(flown, Track) else flown.track, type(flown).__name__)
    ends_s = next((getattr(flown, each) for each in ("duration_s", "duration") if hasattr(flown, each)), None)
    own_s = float(ends_s) if isinstance(ends_s, int | float | np.number) and ends_s > 0.0 else inf
    ends_s = min(own_s, duration_s + _BEYOND_S, MAX_DURATION_S)
    step_s = max(_STEP_S, ends_s / _MAX_SAMPLES)
    times_s = np.minimum(np.arange(0, max(1, int(np.ceil(ends_s / step_s - 1e-9))) + 1) * step_s, ends_s)
    motion = _of_formula(flown, times_s) if isinstance(flown, Track) else _of_function(name, flown, times_s)
    note = ""
    if "acceleration" not in motion:
        _, motion["velocity"], motion["acceleration"] = local_fit(times_s, motion["position"], _NEIGHBOURS)
        note = f"track {name}: velocity and acceleration follow from its positions"
    return Trajectory(f"samples:{name}", columns_of(times_s, motion), note)


def _of_formula(track: Track, times_s: Array) -> Motion:
    motion = {name: position(track, times_s, order) for order, name in enumerate(_NAMES[:3])}
    yaw = {} if track.yaw is None else {"yaw": track.yaw(track.clock(times_s, 1)).derivative(0)[:, None]}
    return motion | yaw


def _of_function(name: str, given: Any, times_s: Array) -> Motion:
    functions = {part: getattr(given, part) for part in _NAMES if callable(getattr(given, part, None))}
    whole = None if functions else next((f for f in (getattr(given, "update", None), given) if callable(f)), None)
    if "position" not in functions and whole is None:
        raise TrackError(f"track {name}: {_EXPECTED}, not {type(given).__name__}")
    samples = []
    for t in times_s.tolist():
        try:
            values = _parts(whole(t)) if whole else {part: function(t) for part, function in functions.items()}
            samples.append({part: _numbers(value, 1 if part == "yaw" else 3) for part, value in values.items()})
        except Exception as error:  # of the user's function
            if t == 0.0 and (series := _of_series(whole or functions["position"], times_s)) is not None:
                return series
            words = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise TrackError(f"track {name}: at t = {t:.3f} s: {words}: {_EXPECTED}") from error
    if any(sample.keys() != samples[0].keys() for sample in samples):
        raise TrackError(f"track {name}: returns sometimes more and sometimes less: {_EXPECTED}")
    return {part: np.array([sample[part] for sample in samples]) for part in samples[0]}


def _of_series(formula: Callable[[Any], Any], times_s: Array) -> Motion | None:
    """Sample a formula as in a class of track options, of which all derivatives are known."""
    try:
        motion = _of_formula(Track(in_series(formula), duration_s=float(times_s[-1])), times_s)
    except Exception:  # the user's formula may raise anything, and the caller reports what it raised for a number
        return None
    right = motion["position"].shape[1] == len("xyz") and all(np.isfinite(each).all() for each in motion.values())
    return motion if right else None


def _parts(value: Any) -> dict[str, Any]:
    if isinstance(value, Mapping):
        named = {part: value.get(part, value.get(_OTHERS.get(part))) for part in _NAMES}
        return {part: each for part, each in named.items() if each is not None}
    several = len(value) in (2, 3) and all(isinstance(each, Sequence | np.ndarray) for each in value)
    flat = not several or all(np.size(each) == 1 for each in value)
    return {"position": value} if flat else dict(zip(_NAMES, value, strict=False))


def _numbers(value: Any, count: int) -> list[float]:
    numbers = np.asarray(value, dtype=np.float64).ravel()
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise ValueError(f"{count} finite numbers, not {value}")
    found: list[float] = numbers.tolist()
    return found
