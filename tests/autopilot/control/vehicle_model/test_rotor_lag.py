"""Rotor lag: followed in closed form, inverted exactly, never beyond the limits."""

from math import exp, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.control.vehicle_model.rotor_lag import follow, lead, rotor_lag
from colibri.plant.vehicle.description import load_vehicle

INTERVAL_S = 0.008
LAG = rotor_lag(load_vehicle("hummingbird"), INTERVAL_S)
parts = st.floats(0.0, 1.0)


def four(value: float) -> np.ndarray:
    return np.full(4, value)


def test_rotors_follow_as_the_vehicle_file_says() -> None:
    up, down = follow(four(0.3), four(0.8), LAG)[0], follow(four(0.8), four(0.3), LAG)[0]
    assert up == pytest.approx(0.8 - 0.5 * exp(-INTERVAL_S / 0.0125))
    assert down == pytest.approx(0.3 + 0.5 * exp(-INTERVAL_S / 0.025))


@given(st.floats(0.3, 1.0), st.floats(LAG.min_speed, 1.0))
def test_a_plan_within_the_limits_needs_no_cutting(speed: float, commanded: float) -> None:
    """The plan's lag is the slower one, so that what it asks for within the limits can be had within the limits."""
    squared = speed**2 + (commanded**2 - speed**2) * (1.0 - exp(-INTERVAL_S / 0.025))
    after = follow(four(speed), lead(four(speed), four(commanded**2), LAG, 1.0), LAG)
    assert after[0] == pytest.approx(sqrt(squared))


@given(parts, st.floats(-1.0, 2.0))
def test_commands_stay_within_the_limits(speed: float, squared: float) -> None:
    commands = lead(four(speed), four(squared), LAG, 0.9)
    assert (commands >= LAG.min_speed).all()
    assert (commands <= 0.9).all()


def test_without_lag_speed_is_the_command() -> None:
    lag = rotor_lag(load_vehicle("hummingbird-thesis"), INTERVAL_S)
    assert lead(four(0.2), four(0.25), lag, 1.0) == pytest.approx(four(0.5))
    assert follow(four(0.2), four(0.5), lag) == pytest.approx(four(0.5))
