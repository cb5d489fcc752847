"""Accelerometer or gyroscope suddenly off, in flight on sensors: the vehicle stays, and says why it twitched."""

from math import dist

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.types import Vector
from colibri.mavlink.hil.faults import ACCELEROMETER, GYROSCOPE, OK, SLOW, WRONG
from colibri.mavlink.hil.feedback import Feedback
from tools.harness.copter_flight import ACCEPTED, CopterFlight

OFF, WELL = "accelerometer off: bias reset", "accelerometer accepted again"
TURNS = "gyroscope off: bias reset"


def stays(flight: CopterFlight, seconds: float, max_m: Vector) -> None:
    """Fly for so long, never farther from here than `max_m` up, down and sideways."""
    x, y, z = flight.position
    up_m, down_m, away_m = max_m
    path = flight.path(seconds)
    assert max(place[2] for place in path) - z < up_m
    assert z - min(place[2] for place in path) < down_m
    assert max(dist(place[:2], (x, y)) for place in path) < away_m


@pytest.mark.parametrize(
    ("bias", "seed"), [((0.0, 0.0, 2.0), 1), pytest.param((1.0, 0.0, 0.0), 3, marks=pytest.mark.long)]
)
def test_a_sudden_bias_is_learned_and_its_end_too(bias: Vector, seed: int) -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=seed)
    flight.takeoff(10.0)
    flight.run(2.0)
    assert not flight.client.said(OFF)
    assert flight.inject(ACCELEROMETER, WRONG, 0, *bias) == ACCEPTED
    stays(flight, 7.0, (1.0, 1.0, 1.0))
    assert flight.client.texts[-2:] == [OFF, WELL]
    assert flight.estimate is not None
    assert flight.estimate.resets == 1
    assert flight.estimate.accel_bias_m_s2 == pytest.approx(bias, abs=0.3)
    assert flight.inject(ACCELEROMETER, OK) == ACCEPTED
    stays(flight, 7.0, (1.0, 1.0, 1.0))
    assert flight.client.texts[-2:] == [OFF, WELL]
    assert flight.estimate.resets == 2
    assert flight.mode is Mode.HOLD
    assert not flight.client.said("lost")


@pytest.mark.long
@pytest.mark.parametrize(
    "bias",
    [(0.02, 0.0, 0.0), *(pytest.param(more, marks=pytest.mark.long) for more in ((0.0, -0.1, 0.0), (0.2, 0.2, 0.1)))],
)
def test_a_gyroscope_that_is_suddenly_off_is_learned_and_its_end_too(bias: Vector) -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=3)
    flight.takeoff(10.0)
    flight.run(2.0)
    assert not flight.client.said(TURNS)
    assert flight.estimate is not None
    own = flight.estimate.gyro_bias_rad_s
    assert flight.inject(GYROSCOPE, WRONG, 0, *bias) == ACCEPTED
    stays(flight, 9.0, (1.0, 1.0, 1.0))
    assert flight.client.said(TURNS)
    assert flight.estimate.gyro_bias_rad_s == pytest.approx([a + b for a, b in zip(own, bias, strict=True)], abs=2e-3)
    assert flight.inject(GYROSCOPE, OK) == ACCEPTED
    stays(flight, 9.0, (1.0, 1.0, 1.0))
    assert flight.estimate.gyro_bias_rad_s == pytest.approx(own, abs=2e-3)
    assert flight.mode is Mode.HOLD
    assert not flight.client.said("lost")


@pytest.mark.long
def test_a_gyroscope_that_drifts_is_followed() -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=3)
    flight.takeoff(10.0)
    assert flight.inject(GYROSCOPE, SLOW, 0, 0.01) == ACCEPTED
    stays(flight, 20.0, (1.0, 1.0, 1.0))
    assert flight.client.said(TURNS)
    assert not flight.client.said("lost")
