"""The estimator's errors are as large as it says: NEES and NIS over seeded flights lie within the bounds of χ²."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pytest

from colibri.analysis.estimation import NAVIGATION, Errors, bounds
from colibri.autopilot.estimation.estimator import Estimator
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.rotations import rotation_matrix
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle
from tests.support import sensor_source as source

FLIGHTS = 16
DURATION_S = 30.0
EVERY = 125
OFTEN = 5  # frames between two looks: no sensor but the inertial ones measures more often
SETTLED = 2000
NIS_LEVEL = 0.999


class Run(NamedTuple):
    """Of all flights: NEES of all, position, velocity, attitude, (flights, instants, 4), and mean NIS by kind."""

    nees: Array
    nis: dict[str, float]


def errors_of(x: Array, P: Array, position: Array, velocity: Array, rotation: Array) -> Errors:
    """Return the true position, velocity and rotation (earth from body) less those of the state `x`."""
    w, a, b, c = x[6:10].tolist()
    turn = np.array(rotation_matrix((w, a, b, c))).T @ rotation
    small = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return Errors(np.concatenate([position - x[:3], velocity - x[3:6], small]), P[:NAVIGATION, :NAVIGATION].copy())


def share_within(means: Array | float, within: tuple[float, float]) -> float:
    """Return which part of the means over flights, one at each instant, lies within the bounds."""
    lower, upper = within
    return float(np.mean((lower <= np.asarray(means)) & (np.asarray(means) <= upper)))


@lru_cache(maxsize=2)
def run(path: source.Path) -> Run:
    sensors = load_vehicle("hummingbird").sensors
    assert sensors is not None
    nees: list[list[tuple[float, ...]]] = []
    nis: dict[str, list[float]] = {}
    for seed in range(FLIGHTS):
        flight = source.record(path, sensors, seed, DURATION_S)
        estimator = Estimator(sensors, source.GRAVITY_M_S2, DEFAULT_ORIGIN, source.INTERVAL_US)
        nees.append([])
        last: dict[str, int] = {}
        for k, frame in enumerate(flight.frames):
            estimator.receive(frame)
            if k % OFTEN or k < SETTLED or (estimate := estimator.estimate()) is None:
                continue
            for kind, test in estimate.tests.items():
                if test.time_us != last.get(kind):
                    last[kind] = test.time_us
                    nis.setdefault(kind, []).append(test.nis)
            if k % EVERY == 0:
                at = estimator.filter_us // source.INTERVAL_US
                truth = flight.motion
                errors = errors_of(
                    estimator.filter.x, estimator.filter.P, truth.position[at], truth.velocity[at], truth.attitude[at]
                )
                nees[-1].append((errors.nees(), errors.nees(0, 3), errors.nees(3, 3), errors.nees(6, 3)))
    return Run(np.array(nees), {kind: float(np.mean(values)) for kind, values in nis.items()})


@pytest.mark.parametrize("path", [source.circle, pytest.param(source.hover, marks=pytest.mark.long)])
@pytest.mark.parametrize(("part", "numbers"), [(0, 9), (1, 3), (2, 3), (3, 3)])
def test_nees_is_within_its_bounds(path: source.Path, part: int, numbers: int) -> None:
    """At one instant in twenty it may not be, and errors last for some of them."""
    means = run(path).nees[:, :, part].mean(axis=0)
    assert share_within(means.mean(), bounds(numbers, FLIGHTS)) == 1.0
    assert share_within(means, bounds(numbers, FLIGHTS)) >= 0.85


@pytest.mark.parametrize("path", [source.circle, pytest.param(source.hover, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("kind", "numbers", "rate_hz"),
    [("velocity", 3, 10.0), ("position", 2, 10.0), ("height", 1, 10.0), ("pressure", 1, 50.0), ("field", 3, 50.0)],
)
def test_nis_is_within_its_bounds(path: source.Path, kind: str, numbers: int, rate_hz: float) -> None:
    """Innovations of a right filter are white: their mean is that of as many independent ones."""
    count = round(FLIGHTS * (DURATION_S - SETTLED * source.INTERVAL_US * 1e-6) * rate_hz)
    assert share_within(run(path).nis[kind], bounds(numbers, count, NIS_LEVEL)) == 1.0


def test_bounds_of_a_textbook() -> None:
    """Bar-Shalom's example 5.4: 50 runs of two numbers, 95 %."""
    assert bounds(2, 50) == pytest.approx((1.484, 2.591), abs=1e-3)


def test_an_error_that_is_believed_too_small_is_found() -> None:
    chance = np.random.default_rng(1)
    wrong = (chance.normal(size=(50, 200, 3)) ** 2 / 0.5).sum(axis=2).mean(axis=0)
    assert share_within(wrong, bounds(3, 50)) < 0.05
