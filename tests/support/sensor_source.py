"""Sensors without a plant: exact motion along an analytic path, measured as the parts say of themselves, seeded."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import exp, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, geodetic_of
from colibri.common.earth.magnetic_field import field_enu_gauss
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame, Updated
from colibri.plant.vehicle.sensors import Sensors

Path: TypeAlias = Callable[[Array], Array]
"""Times, s, (n,) to position, m ENU, and yaw, rad, (n, 4); four times differentiable."""

GRAVITY_M_S2 = 9.81
INTERVAL_US = 4000
REST_S = 4.0  # every path begins with rest
_STENCIL_S = 2e-3


def smooth_step(t: Array, begin_s: float, duration_s: float) -> Array:
    """Go from 0 to 1 with three derivatives that vanish at both ends."""
    s = np.clip((t - begin_s) / duration_s, 0.0, 1.0)
    step: Array = s**5 * (126.0 + s * (-420.0 + s * (540.0 + s * (-315.0 + 70.0 * s))))
    return step


def circle(t: Array) -> Array:
    """Climb in a spiral of 2 m at about 3 m/s, turning: the pace of the thesis's spiral."""
    going = np.clip(t - REST_S, 0.0, None)
    phase = 1.5 * going * smooth_step(t, REST_S, 6.0)
    radius = 2.0
    return np.column_stack(
        [radius * np.cos(phase), radius * np.sin(phase), 0.2 * going * smooth_step(t, REST_S, 4.0), 0.7 * phase]
    )


def hover(t: Array) -> Array:
    up = smooth_step(t, REST_S, 5.0)
    return np.column_stack([0.05 * up * np.sin(0.9 * t), 0.04 * up * np.sin(1.3 * t), 5.0 * up, 0.02 * up * np.sin(t)])


def climb(t: Array) -> Array:
    up = smooth_step(t, REST_S, 10.0)
    return np.column_stack([0.0 * t, 0.0 * t, 20.0 * up, 0.0 * t])


class Motion(NamedTuple):
    """A path with its derivatives, one row for each time: SI, ENU and FLU."""

    position: Array
    velocity: Array
    attitude: Array
    """Rotation matrices, (n, 3, 3)."""
    force: Array
    rate: Array


def motion_along(path: Path, t: Array) -> Motion:
    """Fly along a path with the thrust along body z: derivatives by stencils that are exact to nine digits."""
    h = _STENCIL_S
    attitude = [_attitude(path, t + k * h) for k in (-2, -1, 0, 1, 2)]
    turning = (attitude[0] - 8.0 * attitude[1] + 8.0 * attitude[3] - attitude[4]) / (12.0 * h)
    R = attitude[2]
    spin = np.einsum("nji,njk->nik", R, turning)
    velocity, acceleration = _derivatives(path, t)
    carried = acceleration + np.array([0.0, 0.0, GRAVITY_M_S2])
    return Motion(
        position=path(t)[:, :3],
        velocity=velocity,
        attitude=R,
        force=np.einsum("nji,nj->ni", R, carried),
        rate=np.column_stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]]),
    )


def _derivatives(path: Path, t: Array) -> tuple[Array, Array]:
    h = _STENCIL_S
    a, b, c, d, e = (path(t + k * h)[:, :3] for k in (-2, -1, 0, 1, 2))
    return (a - 8.0 * b + 8.0 * d - e) / (12.0 * h), (-a + 16.0 * b - 30.0 * c + 16.0 * d - e) / (12.0 * h * h)


def _attitude(path: Path, t: Array) -> Array:
    _, acceleration = _derivatives(path, t)
    yaw = path(t)[:, 3]
    up = acceleration + np.array([0.0, 0.0, GRAVITY_M_S2])
    up /= np.linalg.norm(up, axis=1)[:, None]
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw), np.zeros(len(t))])
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left, axis=1)[:, None]
    return np.stack([np.cross(left, up), left, up], axis=2)


@dataclass(frozen=True)
class Faults:
    """What is to be other than the parts say."""

    gyro_bias_rad_s: Vector | None = None
    accel_bias_m_s2: Vector | None = None
    gps_lost_s: tuple[float, float] = (0.0, 0.0)


class Recording(NamedTuple):
    frames: list[SensorFrame]
    motion: Motion
    gyro_bias: Array
    accel_bias: Array


def record(
    path: Path,
    sensors: Sensors,
    seed: int,
    duration_s: float,
    faults: Faults | None = None,
    origin: Geodetic = DEFAULT_ORIGIN,
) -> Recording:
    faults = faults or Faults()
    dt = INTERVAL_US * 1e-6
    t: Array = np.arange(round(duration_s / dt), dtype=np.float64) * dt
    motion = motion_along(path, t)
    chances = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(5)]
    a, g = sensors.accelerometer, sensors.gyroscope
    of_force = (a.noise_density_m_s2_rthz, a.bias_walk_m_s3_rthz, a.turn_on_bias_m_s2, a.range_m_s2)
    of_rate = (g.noise_density_rad_s_rthz, g.bias_walk_rad_s2_rthz, g.turn_on_bias_rad_s, g.range_rad_s)
    force, accel_bias = _inertial(motion.force, of_force, dt, chances[0], faults.accel_bias_m_s2)
    rate, gyro_bias = _inertial(motion.rate, of_rate, dt, chances[1], faults.gyro_bias_rad_s)
    fields = _fields(motion, sensors, chances[2], origin)
    pressures = _pressures(motion, sensors, dt, chances[3], origin)
    fixes = dict(_fixes(path, t, sensors, chances[4], faults, origin))
    field_due, pressure_due = (_due(len(t), dt, hz) for hz in (sensors.magnetometer.rate_hz, sensors.barometer.rate_hz))
    frames = [
        SensorFrame(
            time_us=k * INTERVAL_US,
            updated=int(
                Updated.ACCELEROMETER
                | Updated.GYROSCOPE
                | (Updated.MAGNETOMETER if field_due[k] else 0)
                | (Updated.BAROMETER if pressure_due[k] else 0)
            ),
            specific_force_flu_m_s2=tuple(force[k].tolist()),
            rate_flu_rad_s=tuple(rate[k].tolist()),
            magnetic_field_flu_gauss=tuple(fields[k].tolist()),
            pressure_pa=float(pressures[k]),
            temperature_c=15.0,
            gps=fixes.get(k),
        )
        for k in range(len(t))
    ]
    return Recording(frames, motion, gyro_bias, accel_bias)


def _due(count: int, dt: float, rate_hz: float) -> NDArray[np.bool_]:
    tick = np.floor(np.arange(count) * dt * rate_hz + 1e-9)
    return np.concatenate([[True], np.diff(tick) > 0.0])


def _inertial(
    truth: Array, part: tuple[float, float, float, float], dt: float, chance: np.random.Generator, bias: Vector | None
) -> tuple[Array, Array]:
    density, walk, turn_on, maximum = part
    first = chance.normal(size=3) * turn_on if bias is None else np.array(bias)
    biases = first + np.cumsum(chance.normal(size=truth.shape) * walk * sqrt(dt), axis=0)
    return np.clip(truth + biases + chance.normal(size=truth.shape) * density / sqrt(dt), -maximum, maximum), biases


def _fields(motion: Motion, sensors: Sensors, chance: np.random.Generator, origin: Geodetic) -> Array:
    part = sensors.magnetometer
    iron = chance.normal(size=3) * part.hard_iron_gauss
    body = np.einsum("nji,j->ni", motion.attitude, np.array(field_enu_gauss(origin)))
    fields: Array = body + iron + chance.normal(size=body.shape) * part.noise_gauss
    return fields


def _pressures(motion: Motion, sensors: Sensors, dt: float, chance: np.random.Generator, origin: Geodetic) -> Array:
    part = sensors.barometer
    height = motion.position[:, 2] + origin.altitude_m
    drift = gauss_markov(len(height), 1, dt, part.drift_pa, part.drift_time_s, chance)[:, 0]
    pressures: Array = 101325.0 * (1.0 - 0.0065 * height / 288.15) ** 5.25588
    return pressures + drift + chance.normal(size=len(height)) * part.noise_pa


def gauss_markov(count: int, axes: int, dt: float, sigma: float, time_s: float, chance: np.random.Generator) -> Array:
    """Return a first-order Gauss-Markov process, (count, axes), stationary from its beginning."""
    decay = exp(-dt / time_s)
    steps = chance.normal(size=(count, axes)) * sigma
    steps[1:] *= sqrt(1.0 - decay * decay)
    process: Array = lfilter([1.0], [1.0, -decay], steps, axis=0)
    return process


def _fixes(
    path: Path, t: Array, sensors: Sensors, chance: np.random.Generator, faults: Faults, origin: Geodetic
) -> Iterator[tuple[int, GpsFix]]:
    part = sensors.gps
    told = np.flatnonzero(_due(len(t), INTERVAL_US * 1e-6, part.rate_hz))[1:]
    times: Array = t[told] - part.delay_s
    measured = motion_along(path, times)
    noise = np.array([part.horizontal_noise_m, part.horizontal_noise_m, part.vertical_noise_m])
    drift = gauss_markov(len(told), 3, 1.0 / part.rate_hz, 1.0, part.drift_time_s, chance)
    drift *= np.array([part.horizontal_drift_m, part.horizontal_drift_m, part.vertical_drift_m])
    places = measured.position + drift + chance.normal(size=drift.shape) * noise
    speeds = measured.velocity + chance.normal(size=drift.shape) * part.velocity_noise_m_s
    begin_s, end_s = faults.gps_lost_s
    for k, place, speed in zip(told.tolist(), places, speeds, strict=True):
        if not begin_s <= t[k] < end_s:
            yield (
                k,
                GpsFix(
                    time_us=k * INTERVAL_US,
                    fix_type=part.fix_type,
                    place=_on_wire(geodetic_of(tuple(place.tolist()), origin)),
                    velocity_enu_m_s=tuple(np.round(speed, 2).tolist()),
                    horizontal_accuracy_m=round(sqrt(part.horizontal_noise_m**2 + part.horizontal_drift_m**2), 2),
                    vertical_accuracy_m=round(sqrt(part.vertical_noise_m**2 + part.vertical_drift_m**2), 2),
                    satellites=part.satellites,
                ),
            )


def _on_wire(place: Geodetic) -> Geodetic:
    return Geodetic(round(place.latitude_deg, 7), round(place.longitude_deg, 7), round(place.altitude_m, 3))
