"""The cost of a flight: its gradient is that of its value, and it counts what is beyond the limits and the floor."""

from functools import cache
from math import inf
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.reach import Reach
from colibri.autopilot.guidance.trajectories.time_optimal.cost import FlightCost
from colibri.autopilot.guidance.trajectories.waypoint_file import Waypoints, read_waypoints
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle

GIVEN = np.array([[0.0, 0.0, 1.0], [6.0, 1.0, 3.0], [4.0, 7.0, 0.5], [0.0, 3.0, 2.0]])
WAYPOINTS = Waypoints(Path("points.csv"), np.arange(4.0), GIVEN, None, timed=False)


@cache
def reach() -> Reach:
    return Reach(load_vehicle("hummingbird"), load_profile("flight"), exact_drag=True)


def cost(pieces: int, weight: float, floor_m: float = -inf, given: Waypoints = WAYPOINTS) -> FlightCost:
    found = FlightCost(reach(), given, pieces)
    found.weight, found.floor_m = weight, floor_m
    return found


def points(pieces: int) -> Array:
    part = np.arange(pieces * 3 + 1) / pieces
    lines = np.stack([np.interp(part, np.arange(4), axis) for axis in GIVEN.T], axis=1)
    between = np.arange(len(part)) % pieces > 0
    return lines + np.where(between[:, None], 0.3 * np.sin(np.arange(lines.size)).reshape(lines.shape), 0.0)


WINDOWS = "x,y,z,width,height,facing\n0,0,1,0,0,0\n6,1,3,2,1,40\n4,7,0.5,1,0,120\n0,3,2,0,0,0\n"


def opened(text: str | None = None, tolerance_m: float | None = None) -> Waypoints:
    lines = "x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in GIVEN)
    return read_waypoints(Path("points.csv"), "max", text=text or lines, tolerance_m=tolerance_m)


@pytest.mark.parametrize("pieces", [1, 2, 4])
@pytest.mark.parametrize("leg_s", [0.7, 1.4])
@pytest.mark.parametrize(
    "given", [WAYPOINTS, opened(tolerance_m=0.5), opened(WINDOWS)], ids=["points", "balls", "windows"]
)
def test_the_gradient_is_that_of_the_value(pieces: int, leg_s: float, given: Waypoints) -> None:
    function = cost(pieces, 100.0, 0.8, given)
    x = function.variables(np.array([leg_s, 1.2 * leg_s, leg_s]), points(pieces))
    x[-3 * len(GIVEN) :] += 0.0 if given.openings is None else 0.2
    value, gradient = function(x)
    assert value > 4.0 * leg_s, "something is beyond the limits"
    for k in range(0, len(x), 4):
        step = np.where(np.arange(len(x)) == k, 1e-6, 0.0)
        slope = (function(x + step)[0] - function(x - step)[0]) / 2e-6
        assert gradient[k] == pytest.approx(slope, rel=1e-4, abs=1e-2)


def test_a_flight_within_the_limits_costs_its_duration() -> None:
    function = cost(1, 1e6)
    value, gradient = function(function.variables(np.array([8.0, 9.0, 10.0]), GIVEN))
    assert value == pytest.approx(27.0)
    assert (gradient > 0.0).all()


def test_variables_are_the_leg_times_and_the_points_between() -> None:
    function, legs_s = cost(2, 1.0), np.array([0.02, 1.0, 40.0])
    x = function.variables(legs_s, points(2))
    assert len(x) == 3 + 9
    back_s, passed = function.flight(x)
    assert back_s == pytest.approx(legs_s, rel=1e-12)
    assert (passed == points(2)).all()
    assert (function.flight(x - 50.0)[0] > 0.0).all()


def test_what_is_below_the_floor_costs() -> None:
    x = cost(1, 1.0).variables(np.array([8.0, 9.0, 10.0]), GIVEN)
    low, lower = (cost(1, 100.0, floor_m)(x)[0] - 27.0 for floor_m in (0.7, 0.9))
    assert 0.0 < low < lower
