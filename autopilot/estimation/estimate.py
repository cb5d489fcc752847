"""The estimated state, its standard deviations, and the health of its sources."""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple, TypeAlias

from colibri.autopilot.estimation.sensing.rejection import Rejections
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import mav


class Test(NamedTuple):
    """Last test of a measurement.

    Attributes:
        time_us: -1 before the first.
        innovation: Measured minus expected, in the unit of the measurement.
        nis: Normalised innovation squared, χ² distributed.
        gate: Largest accepted NIS.
    """

    time_us: int
    innovation: tuple[float, ...]
    nis: float
    gate: float

    @property
    def ratio(self) -> float:
        """Test ratio of ESTIMATOR_STATUS: rejected above 1."""
        return self.nis / self.gate


Tests: TypeAlias = Mapping[str, Test]
"""Last test of each measurement, by name."""


_HORIZONTAL_VELOCITY = mav.ESTIMATOR_VELOCITY_HORIZ | mav.ESTIMATOR_POS_HORIZ_REL | mav.ESTIMATOR_PRED_POS_HORIZ_REL
_HORIZONTAL_POSITION = mav.ESTIMATOR_POS_HORIZ_ABS | mav.ESTIMATOR_PRED_POS_HORIZ_ABS


class Health(NamedTuple):
    """Usable parts of the estimate.

    Attributes:
        attitude, heading: Roll and pitch to 10°, yaw to 15°.
        horizontal_velocity, vertical_velocity: To 1 m/s.
        horizontal_position, height: To 5 m.
        dead_reckoning: Without GPS, position and velocity drift.
        gps_lost_since_us: Time of the last accepted fix, if GPS is lost.
        gps_glitch: Fixes are received but rejected.
        accel_bias, gyro_bias: False for a while after a reset of the bias.
        not_accepted: Other sensors with missing or rejected values.
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
        """ESTIMATOR_STATUS_FLAGS."""
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
    """The filter at its own time, for consistency checks.

    Attributes:
        state: Position (m, ENU), velocity (m/s, ENU), attitude (wxyz), (10,).
        covariance: Upper triangle of position, velocity and attitude (body rotation vector), 45 numbers by rows.
        nis, accepted: Sum and number of the accepted NIS, for each of `Tests`.
    """

    time_us: int
    state: tuple[float, ...]
    covariance: tuple[float, ...]
    nis: tuple[float, ...]
    accepted: tuple[int, ...]


class Estimate(NamedTuple):
    """The vehicle at one instant.

    Attributes:
        frame: Current state; rates without bias.
        position_std_m, velocity_std_m_s: Standard deviations, ENU.
        attitude_std_rad: Standard deviations about east, north, up.
        gyro_bias_rad_s, accel_bias_m_s2: FLU.
        rejected: Number of rejected values since the start, by sensor and reason.
        resets: Number of resets of position, velocity or a reference.
        smoothing_m: Filter position minus published position, ENU.
        check: Ten times a second.
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
