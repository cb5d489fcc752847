"""The estimate of the vehicle's state, its standard deviations, and the health of what it is made of."""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple, TypeAlias

from colibri.autopilot.estimation.sensing.rejection import Rejections
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import mav


class Test(NamedTuple):
    """The last test of a kind of measurement.

    Attributes:
        time_us: When, µs; -1 before the first.
        innovation: Measured less expected, in the unit of the measurement.
        nis: Normalised innovation squared: χ² of as many degrees of freedom as the innovation has numbers.
        gate: What is above is rejected.
    """

    time_us: int
    innovation: tuple[float, ...]
    nis: float
    gate: float

    @property
    def ratio(self) -> float:
        """As in ESTIMATOR_STATUS: what is above 1 was rejected."""
        return self.nis / self.gate


Tests: TypeAlias = Mapping[str, Test]
"""The last test of each kind of measurement that the vehicle has, by name."""


_HORIZONTAL_VELOCITY = mav.ESTIMATOR_VELOCITY_HORIZ | mav.ESTIMATOR_POS_HORIZ_REL | mav.ESTIMATOR_PRED_POS_HORIZ_REL
_HORIZONTAL_POSITION = mav.ESTIMATOR_POS_HORIZ_ABS | mav.ESTIMATOR_PRED_POS_HORIZ_ABS


class Health(NamedTuple):
    """What may be flown on.

    Attributes:
        attitude, heading: Whether roll and pitch, and yaw, are known.
        horizontal_velocity, vertical_velocity: Known to 1 m/s.
        horizontal_position, height: Known to 5 m on earth.
        dead_reckoning: GPS holds neither position nor velocity: they drift.
        gps_lost_since_us: When GPS was last accepted, if that is long ago; None while it is.
        gps_glitch: Fixes come, and are rejected.
        accelerometer, gyroscope: Their values can be used.
        accel_bias, gyro_bias: Their biases were not reset lately.
        not_accepted: Other sensors whose values are missing or rejected since long.
    """

    attitude: bool
    heading: bool
    horizontal_velocity: bool
    vertical_velocity: bool
    horizontal_position: bool
    height: bool
    dead_reckoning: bool
    gps_lost_since_us: int | None
    gps_glitch: bool
    accelerometer: bool
    gyroscope: bool
    accel_bias: bool
    gyro_bias: bool
    not_accepted: tuple[str, ...]

    @property
    def flags(self) -> int:
        """ESTIMATOR_STATUS_FLAGS of MAVLink."""
        return _flags(self)


@lru_cache(maxsize=16)  # asked for at every control sample, and hardly ever another
def _flags(health: Health) -> int:
    flags: int = (
        health.attitude * mav.ESTIMATOR_ATTITUDE
        | health.horizontal_velocity * _HORIZONTAL_VELOCITY
        | health.vertical_velocity * mav.ESTIMATOR_VELOCITY_VERT
        | health.horizontal_position * _HORIZONTAL_POSITION
        | health.height * mav.ESTIMATOR_POS_VERT_ABS
        | health.gps_glitch * mav.ESTIMATOR_GPS_GLITCH
        | (not (health.accelerometer and health.accel_bias)) * mav.ESTIMATOR_ACCEL_ERROR
    )
    return flags


class Check(NamedTuple):
    """The filter at its own time, with its covariance, so that its consistency can be checked.

    Attributes:
        time_us: The filter's time, µs.
        state: Position (m, ENU), velocity (m/s, ENU), attitude (wxyz), 10 numbers.
        covariance: Of position, velocity, and attitude as a rotation vector in the body frame: the upper triangle, 45
            numbers, row by row.
        nis: Of each kind of `Tests`, the sum of the normalised innovations squared that were accepted up to now.
        accepted: How many they are.
    """

    time_us: int
    state: tuple[float, ...]
    covariance: tuple[float, ...]
    nis: tuple[float, ...]
    accepted: tuple[int, ...]


class Estimate(NamedTuple):
    """The vehicle at one instant.

    Attributes:
        frame: Its state now; the position is from the origin, the rates are without their bias.
        position_std_m: Standard deviations of the position, east, north, up.
        velocity_std_m_s: Of the velocity, east, north, up.
        attitude_std_rad: Of the attitude, about east, north, up.
        gyro_bias_rad_s, accel_bias_m_s2: FLU.
        tests: How well the measurements agree with it.
        rejected: How many values were rejected since the start, by sensor and reason.
        resets: How often position, velocity or a reference was reset, because measurements had long contradicted it.
        smoothing_m: Part of the published position that is still to move to the filter's, east, north, up.
        check: The filter with its covariance, ten times a second; None between.
    """

    frame: StateFrame
    position_std_m: Vector
    velocity_std_m_s: Vector
    attitude_std_rad: Vector
    gyro_bias_rad_s: Vector
    accel_bias_m_s2: Vector
    health: Health
    tests: Tests
    rejected: Rejections
    resets: int
    smoothing_m: Vector
    check: Check | None
