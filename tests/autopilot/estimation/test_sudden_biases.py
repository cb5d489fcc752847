"""Sudden biases of accelerometer and gyroscope are detected, without false alarms."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from math import hypot

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.estimator import Estimator
from colibri.autopilot.estimation.sensing.rejection import RejectedSource
from colibri.common.earth.geodesy import geodetic_of
from colibri.common.types import Vector
from colibri.flights.snapshots import ObjectSnapshot
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame
from tests.support import sensor_source as source
from tests.support.estimates import Change, error_m, estimates, estimator, known, recorded
from tests.support.sensor_source import INTERVAL_US, Recording

BEGAN_S = 16.0
LONG = pytest.mark.long
PATHS = [source.circle, pytest.param(source.hover, marks=LONG)]
GpsLie = Callable[[GpsFix, float], GpsFix]


def plus(vector: Vector, other: Vector, times: float = 1.0) -> Vector:
    (x, y, z), (a, b, c) = vector, other
    return (x + times * a, y + times * b, z + times * c)


def fails(change: Change) -> Change:
    return lambda frame, t: change(frame, t - BEGAN_S)


@lru_cache(maxsize=2)
def begun(path: source.Path, seed: int, duration_s: float) -> tuple[Estimator, ObjectSnapshot, list[Estimate | None]]:
    seeing, frames = estimator(), recorded(path, seed, duration_s).frames
    of = [seeing.step(frame) for frame in frames if frame.time_us * 1e-6 < BEGAN_S]
    return seeing, ObjectSnapshot([seeing]), of


def failing(path: source.Path, seed: int, duration_s: float, change: Change) -> tuple[Recording, list[Estimate | None]]:
    """Return a recording, and its estimates with a change from `BEGAN_S` on."""
    flight, (seeing, snapshot, of) = recorded(path, seed, duration_s), begun(path, seed, duration_s)
    snapshot.restore()
    return flight, [*of, *(seeing.step(change(frame, frame.time_us * 1e-6)) for frame in flight.frames[len(of) :])]


def felt(bias: Vector) -> Change:
    return fails(lambda frame, _: frame._replace(specific_force_flu_m_s2=plus(frame.specific_force_flu_m_s2, bias)))


def told(lie: GpsLie) -> Change:
    return fails(lambda frame, t: frame if frame.gps is None else frame._replace(gps=lie(frame.gps, t)))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "bias",
    [
        *((0.0, 0.0, 2.0), (0.8, -0.6, 0.9), (-6.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        *(pytest.param(bias, marks=LONG) for bias in ((0.0, 0.0, -2.0), (0.0, -1.0, 0.0))),
    ],
)
def test_a_sudden_accelerometer_bias_is_found_in_time(path: source.Path, bias: Vector) -> None:
    flight, of = failing(path, 3, 22.5, felt(bias))
    last = known(of)[-1]
    learning = [one for one in known(of) if not one.health.accel_bias]
    assert (learning[0].frame.time_us * 1e-6 - BEGAN_S) < 1.2
    assert all(one.health.gyro_bias for one in known(of))
    assert last.resets == 1
    assert last.health.accel_bias
    assert np.allclose(last.accel_bias_m_s2, flight.accel_bias[-1] + bias, atol=0.25)
    assert max(error_m(flight, of, t) for t in np.arange(BEGAN_S, 21.9, 0.1)) < 1.5
    assert not any(one.health.gps_lost_since_us for one in known(of))
    after = [one for one in known(of) if one.frame.time_us > learning[0].frame.time_us + 1_000_000]
    assert not any(one.health.gps_glitch for one in after)


VELOCITY_ALONE: dict[str, GpsLie] = {
    "velocity slides sideways": lambda fix, t: replace(
        fix, velocity_enu_m_s=plus(fix.velocity_enu_m_s, (1.0, 0.0, 0.0), t)
    ),
    "velocity slides up": lambda fix, t: replace(fix, velocity_enu_m_s=plus(fix.velocity_enu_m_s, (0.0, 0.0, 2.0), t)),
    "velocity is off": lambda fix, _: replace(fix, velocity_enu_m_s=plus(fix.velocity_enu_m_s, (2.0, 0.0, 1.0))),
}


def sliding(way: Vector) -> GpsLie:
    return lambda fix, t: replace(
        fix,
        velocity_enu_m_s=plus(fix.velocity_enu_m_s, way, t),
        place=geodetic_of(plus((0.0, 0.0, 0.0), way, 0.5 * t * t), fix.place),
    )


ALL_OF_GPS = {"all of it slides sideways": sliding((1.5, 0.0, 0.0)), "all of it slides up": sliding((0.0, 0.0, 2.0))}


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("lie", [*VELOCITY_ALONE.values(), *ALL_OF_GPS.values()], ids=[*VELOCITY_ALONE, *ALL_OF_GPS])
def test_a_receiver_that_lies_is_no_bias(path: source.Path, lie: GpsLie) -> None:
    of = known(failing(path, 5, 22.0, told(lie))[1])
    assert of[-1].health.gps_glitch
    assert of[-1].resets == 0
    assert all(one.health.gyro_bias for one in of)


@pytest.mark.parametrize("late_s", [0.2, 0.5, 1.0])
def test_a_late_receiver_is_no_accelerometer_bias(late_s: float) -> None:
    """The vehicle begins its circle while the receiver still reports rest."""
    flight = recorded(source.circle, 4, 12.0)
    fixes = {frame.time_us: frame.gps for frame in flight.frames if frame.gps is not None}

    def late(frame: SensorFrame, t: float) -> SensorFrame:
        if frame.gps is None or t < source.REST_S:
            return frame
        before = fixes[frame.time_us - round(late_s * 1e6)]
        assert before is not None
        return frame._replace(gps=replace(before, time_us=frame.time_us))

    of = known(estimates(flight.frames, late))
    assert of[-1].health.gps_glitch
    assert all(one.health.accel_bias for one in of)


@pytest.mark.parametrize("knock", [(0.0, 0.0, 200.0), (90.0, -60.0, 100.0), (-30.0, 20.0, -10.0)])
def test_a_knock_is_no_accelerometer_bias(knock: Vector) -> None:
    """It is over before the next frame, and was measured wrong: velocity is off by up to half a metre a second."""

    def knocked(frame: SensorFrame, t: float) -> SensorFrame:
        if t >= 1.5 * INTERVAL_US * 1e-6:
            return frame
        return frame._replace(specific_force_flu_m_s2=plus(frame.specific_force_flu_m_s2, knock))

    of = known(failing(source.hover, 7, 19.0, fails(knocked))[1])
    assert any(one.health.gps_glitch for one in of)
    assert all(one.health.accel_bias for one in of)


def turned(bias: Vector, drift: Vector = (0.0, 0.0, 0.0)) -> Change:
    return fails(lambda frame, t: frame._replace(rate_flu_rad_s=plus(plus(frame.rate_flu_rad_s, bias), drift, t)))


def magnetised(iron: Vector, drift: Vector = (0.0, 0.0, 0.0)) -> Change:
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
def test_a_sudden_gyroscope_bias_is_found_in_time(path: source.Path, bias: Vector) -> None:
    flight, of = failing(path, 3, 24.5, turned(bias))
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


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("bias", [(0.8, 0.0, 0.0), (-2.0, 5.0, 0.5)])
def test_a_large_gyroscope_bias_is_found_before_the_vehicle_tilts(path: source.Path, bias: Vector) -> None:
    flight, of = failing(path, 3, 17.0, turned(bias))
    found, biased = next(one for one in known(of) if not one.health.gyro_bias), flight.gyro_bias[-1] + bias
    assert found.frame.time_us * 1e-6 - BEGAN_S < 0.12
    assert np.allclose(found.gyro_bias_rad_s, biased, atol=0.05 * hypot(*bias))
    assert np.allclose(known(of)[-1].gyro_bias_rad_s, biased, atol=0.02)
    assert all(one.health.attitude for one in known(of))
    assert error_m(flight, of, 16.9) < 0.5


@pytest.mark.parametrize("turn", [(0.9, 0.0, 0.0), (-2.0, 5.0, 0.5)])
def test_a_vehicle_that_is_turned_by_a_knock_has_no_gyroscope_bias(turn: Vector) -> None:
    """It turns for 0.1 s from one sample to the next, and back."""

    def knocked(frame: SensorFrame, t: float) -> SensorFrame:
        turned_s = min(t, 0.2 - t)
        if turned_s < 0.0:
            return frame
        to_body = Rotation.from_rotvec(np.array(turn) * turned_s).inv()
        return frame._replace(
            rate_flu_rad_s=plus(frame.rate_flu_rad_s, turn, 1.0 if t < 0.1 else -1.0),
            specific_force_flu_m_s2=tuple(to_body.apply(frame.specific_force_flu_m_s2).tolist()),
            magnetic_field_flu_gauss=tuple(to_body.apply(frame.magnetic_field_flu_gauss).tolist()),
        )

    flight, estimated = failing(source.hover, 7, 18.0, fails(knocked))
    of = known(estimated)
    assert all(one.health.gyro_bias and one.health.attitude for one in of)
    assert np.allclose(of[-1].gyro_bias_rad_s, flight.gyro_bias[-1], atol=0.002)


def test_a_gyroscope_drift_is_followed() -> None:
    flight, of = failing(source.hover, 3, 30.0, turned((0.0, 0.0, 0.0), (0.01, 0.0, 0.0)))
    assert known(of)[-1].gyro_bias_rad_s[0] == pytest.approx(flight.gyro_bias[-1, 0] + 0.14, abs=0.02)
    assert max(error_m(flight, of, t) for t in np.arange(BEGAN_S, 29.9, 0.1)) < 1.5


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
def test_a_field_beside_the_magnetometer_is_no_gyroscope_bias(path: source.Path, change: Change) -> None:
    of = known(failing(path, 5, 25.0, change)[1])
    assert any(RejectedSource.MAGNETOMETER in one.health.not_accepted for one in of)
    assert all(one.health.gyro_bias for one in of)
