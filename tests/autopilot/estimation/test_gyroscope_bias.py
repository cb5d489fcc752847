"""A sudden bias of the gyroscope is found, and nothing that looks like one is taken for it."""

import numpy as np
import pytest

from colibri.autopilot.estimation.sensing.rejection import Source
from colibri.common.types import Vector
from tests import sensor_source as source
from tests.autopilot.estimation.test_accelerometer_bias import (
    ALL_OF_GPS,
    BEGAN_S,
    VELOCITY_ALONE,
    GpsLie,
    fails,
    felt,
    plus,
    told,
)
from tests.autopilot.estimation.test_estimator import Change, error_m, estimates, known, recorded

LONG = pytest.mark.long
PATHS = [source.circle, pytest.param(source.hover, marks=LONG)]


def turned(bias: Vector, drift: Vector = (0.0, 0.0, 0.0)) -> Change:
    """Have the gyroscope be off by a bias, rad/s, that drifts, rad/s²."""
    return fails(lambda frame, t: frame._replace(rate_flu_rad_s=plus(plus(frame.rate_flu_rad_s, bias), drift, t)))


def magnetised(iron: Vector, drift: Vector = (0.0, 0.0, 0.0)) -> Change:
    """Put a field beside the magnetometer, gauss, that grows, gauss/s."""
    return fails(
        lambda frame, t: frame._replace(
            magnetic_field_flu_gauss=plus(plus(frame.magnetic_field_flu_gauss, iron), drift, t)
        )
    )


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "bias",
    [
        *((0.02, 0.0, 0.0), (-0.1, 0.2, 0.1)),
        *(pytest.param(bias, marks=LONG) for bias in ((0.0, -0.02, 0.0), (0.1, 0.0, 0.0), (0.0, 0.3, 0.0))),
    ],
)
def test_a_sudden_bias_is_found_before_it_is_far(path: source.Path, bias: Vector) -> None:
    flight = recorded(path, 3, 24.5)
    of = estimates(flight.frames, turned(bias))
    last = known(of)[-1]
    learning = [one for one in known(of) if not one.health.gyro_bias]
    assert learning[0].frame.time_us * 1e-6 - BEGAN_S < 3.0
    assert last.resets == 1
    assert last.health.gyro_bias
    assert np.allclose(last.gyro_bias_rad_s, flight.gyro_bias[-1] + bias, atol=0.001)
    assert max(error_m(flight, of, t) for t in np.arange(BEGAN_S, 24.4, 0.1)) < 0.7
    assert all(one.health.accel_bias for one in known(of))
    after = [one for one in known(of) if one.frame.time_us > learning[0].frame.time_us + 1_000_000]
    assert not any(one.health.gps_glitch for one in after)
    assert all(one.health.attitude for one in after)


def test_a_drift_is_followed() -> None:
    flight = recorded(source.hover, 3, 30.0)
    of = estimates(flight.frames, turned((0.0, 0.0, 0.0), (0.01, 0.0, 0.0)))
    assert known(of)[-1].gyro_bias_rad_s[0] == pytest.approx(flight.gyro_bias[-1, 0] + 0.14, abs=0.02)
    assert max(error_m(flight, of, t) for t in np.arange(BEGAN_S, 29.9, 0.1)) < 1.5


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("lie", [*VELOCITY_ALONE.values(), *ALL_OF_GPS.values()], ids=[*VELOCITY_ALONE, *ALL_OF_GPS])
def test_a_receiver_that_lies_is_not_taken_for_it(path: source.Path, lie: GpsLie) -> None:
    of = known(estimates(recorded(path, 5, 22.0).frames, told(lie)))
    assert of[-1].health.gps_glitch
    assert all(one.health.gyro_bias for one in of)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "change",
    [
        magnetised((0.2, 0.0, 0.0)),
        magnetised((0.0, 0.0, 0.0), (0.01, 0.0, 0.0)),
        pytest.param(magnetised((0.0, 0.03, 0.0)), marks=LONG),
        pytest.param(magnetised((0.0, 0.0, 0.0), (0.0, 0.003, 0.0)), marks=LONG),
    ],
)
def test_nor_is_a_field_beside_the_magnetometer(path: source.Path, change: Change) -> None:
    of = known(estimates(recorded(path, 5, 25.0).frames, change))
    assert any(Source.MAGNETOMETER in one.health.not_accepted for one in of)
    assert all(one.health.gyro_bias for one in of)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "bias",
    [
        *((0.0, 0.0, 2.0), (1.0, 0.0, 0.0)),
        *(pytest.param(bias, marks=LONG) for bias in ((0.0, -0.5, 0.0), (0.2, 0.2, 0.0))),
    ],
)
def test_nor_is_an_accelerometer_that_errs(path: source.Path, bias: Vector) -> None:
    of = known(estimates(recorded(path, 3, 22.5).frames, felt(bias)))
    assert all(one.health.gyro_bias for one in of)
