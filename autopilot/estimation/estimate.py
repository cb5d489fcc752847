"""What the estimator knows of the vehicle, how well, and what it trusts."""

from collections.abc import Mapping
from enum import IntFlag
from typing import NamedTuple, TypeAlias

from colibri.autopilot.estimation.sensing.rejection import Rejections
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame


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


class StatusFlags(IntFlag):
    """ESTIMATOR_STATUS_FLAGS of MAVLink."""

    ATTITUDE = 1
    VELOCITY_HORIZ = 2
    VELOCITY_VERT = 4
    POS_HORIZ_REL = 8
    POS_HORIZ_ABS = 16
    POS_VERT_ABS = 32
    PRED_POS_HORIZ_REL = 256
    PRED_POS_HORIZ_ABS = 512
    GPS_GLITCH = 1024
    ACCEL_ERROR = 2048


class Health(NamedTuple):
    """What may be flown on.

    Attributes:
        attitude: Roll and pitch are known.
        heading: Yaw is known.
        horizontal_velocity: Known to 1 m/s.
        vertical_velocity: Known to 1 m/s.
        horizontal_position: Known to 5 m on earth.
        height: Known to 5 m.
        dead_reckoning: GPS holds neither position nor velocity: they drift.
        gps_lost_since_us: When GPS was last accepted, if that is long ago; None while it is.
        gps_glitch: Fixes come, and are rejected.
        accelerometer: Its values can be used.
        gyroscope: Its values can be used.
        accel_bias: The accelerometer's bias was not reset lately.
        gyro_bias: Nor the gyroscope's.
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
    def flags(self) -> StatusFlags:
        """As in ESTIMATOR_STATUS."""
        value = sum(flag for good, flag in zip(self._goods(), _FLAGS, strict=True) if good)
        return StatusFlags(value)

    def _goods(self) -> tuple[bool, ...]:
        return (
            self.attitude,
            self.horizontal_velocity,
            self.vertical_velocity,
            self.horizontal_position,
            self.height,
            self.gps_glitch,
            not (self.accelerometer and self.accel_bias),
        )


_FLAGS: tuple[int, ...] = tuple(
    int(flags)
    for flags in (
        StatusFlags.ATTITUDE,
        StatusFlags.VELOCITY_HORIZ | StatusFlags.POS_HORIZ_REL | StatusFlags.PRED_POS_HORIZ_REL,
        StatusFlags.VELOCITY_VERT,
        StatusFlags.POS_HORIZ_ABS | StatusFlags.PRED_POS_HORIZ_ABS,
        StatusFlags.POS_VERT_ABS,
        StatusFlags.GPS_GLITCH,
        StatusFlags.ACCEL_ERROR,
    )
)
"""Of each part of `Health._goods`; as plain numbers, which are added in a tenth of the time."""


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
        gyro_bias_rad_s: FLU.
        accel_bias_m_s2: FLU.
        health: What may be flown on.
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
