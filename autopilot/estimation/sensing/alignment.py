"""Start at rest: means over a second, and their attitude."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.estimation.sensing.inertial import InertialReading
from colibri.common.matrices import matmul, norm
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.sensors import GpsFix
from colibri.plant.vehicle.sensors import Sensors

WINDOW_S = 1.0

_FEWEST_SAMPLES = 20
_FEWEST_FIELDS = 5
_UNREST = 3.0  # allowed spread at rest: this multiple of the sensor noise, plus the next two
_UNREST_M_S2, _UNREST_RAD_S = 0.1, 0.01
_BIASES = 5.0  # allowed deviation of a mean at rest: this multiple of the turn-on bias, plus the next two
_TILT_M_S2, _TURN_RAD_S = 0.3, 0.04
_FIELD_PART = 0.25  # allowed deviation of the field strength from the earth's


class Aligned(NamedTuple):
    """Means at rest, FLU, and the number of fields and heights in them."""

    duration_s: float
    force: Vector
    rate: Vector
    field: Vector
    fields: int
    pressure_height_m: float | None
    heights: int
    fix: GpsFix
    attitude: Quaternion


class Alignment:
    def __init__(self, sensors: Sensors, gravity_m_s2: float, field_enu_gauss: Vector, interval_s: float) -> None:
        accel, gyro = sensors.accelerometer, sensors.gyroscope
        self._gravity = gravity_m_s2
        self._earth_field = field_enu_gauss
        rate_hz = 1.0 / interval_s
        self._unrest_m_s2 = _UNREST * accel.noise_density_m_s2_rthz * sqrt(rate_hz) + _UNREST_M_S2
        self._unrest_rad_s = _UNREST * gyro.noise_density_rad_s_rthz * sqrt(rate_hz) + _UNREST_RAD_S
        self._tilt_m_s2 = _BIASES * accel.turn_on_bias_m_s2 + _TILT_M_S2
        self._turn_rad_s = _BIASES * gyro.turn_on_bias_rad_s + _TURN_RAD_S
        self._begin()

    def _begin(self) -> None:
        self._started_us: int | None = None
        self._motions: list[tuple[float, ...]] = []
        self._fields: list[Vector] = []
        self._heights: list[float] = []
        self._fix: GpsFix | None = None

    def feed(
        self, time_us: int, reading: InertialReading, field: Vector | None, height_m: float | None, fix: GpsFix | None
    ) -> Aligned | None:
        if not (reading.force_good and reading.rate_good):
            self._begin()
            return None
        if self._started_us is None:
            self._started_us = time_us
        self._motions.append((*reading.force, *reading.rate))
        if field is not None:
            self._fields.append(field)
        if height_m is not None:
            self._heights.append(height_m)
        self._fix = fix or self._fix
        if time_us - self._started_us < WINDOW_S * 1e6:
            return None
        aligned = self._aligned((time_us - self._started_us) * 1e-6)
        self._begin()
        return aligned

    def _aligned(self, duration_s: float) -> Aligned | None:
        if len(self._motions) < _FEWEST_SAMPLES or len(self._fields) < _FEWEST_FIELDS or self._fix is None:
            return None
        motions = np.array(self._motions)
        mean, spread = motions.mean(axis=0), motions.std(axis=0)
        force, rate = mean[:3], mean[3:]
        field = np.mean(self._fields, axis=0)
        strength = norm(np.array(self._earth_field))
        if (
            spread[:3].max() > self._unrest_m_s2
            or spread[3:].max() > self._unrest_rad_s
            or abs(norm(force) - self._gravity) > self._tilt_m_s2
            or np.abs(rate).max() > self._turn_rad_s
            or abs(norm(field) - strength) > _FIELD_PART * strength
        ):
            return None
        return Aligned(
            duration_s,
            _vector(force),
            _vector(rate),
            _vector(field),
            len(self._fields),
            float(np.mean(self._heights)) if self._heights else None,
            len(self._heights),
            self._fix,
            attitude_of(force, field, np.array(self._earth_field)),
        )


def attitude_of(force: NDArray[np.float64], field: NDArray[np.float64], earth_field: NDArray[np.float64]) -> Quaternion:
    """Return the attitude from specific force and magnetic field (TRIAD)."""
    body = _triad(force, field)
    earth = _triad(np.array([0.0, 0.0, 1.0]), earth_field)
    return _quaternion(matmul(earth, body.T))


def _triad(up: NDArray[np.float64], field: NDArray[np.float64]) -> NDArray[np.float64]:
    up = up / norm(up)
    east = np.cross(field, up)
    east = east / norm(east)
    return np.column_stack([east, np.cross(up, east), up])


def _quaternion(R: NDArray[np.float64]) -> Quaternion:
    """Convert a rotation matrix by its largest component (Shepperd)."""
    trace = float(np.trace(R))
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    largest = int(np.argmax(squares))
    products = np.array(
        [
            [1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], 1.0 + 2.0 * R[0, 0] - trace, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], 1.0 + 2.0 * R[1, 1] - trace, R[1, 2] + R[2, 1]],
            [R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1.0 + 2.0 * R[2, 2] - trace],
        ]
    )[largest]
    w, x, y, z = (products / norm(products)).tolist()
    return (w, x, y, z)


def _vector(array: NDArray[np.float64]) -> Vector:
    x, y, z = array.tolist()
    return (x, y, z)
