"""The estimated state, its accuracy and health."""

from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple, TypeAlias

from colibri.autopilot.estimation.sensing.rejection import RejectedSource, Rejections
from colibri.common.records import Record
from colibri.common.types import Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import mav


class Test(Record, frozen=True):
    """Last test of a measurement; `time_us` is -1 before the first."""

    time_us: int
    innovation: tuple[float, ...]
    nis: float
    gate: float

    @property
    def ratio(self) -> float:
        """Test ratio of ESTIMATOR_STATUS: rejected above 1."""
        return self.nis / self.gate


_RECKONED_US = 10_000_000  # an accelerometer integrated for so long is up to 1 m/s off
Tests: TypeAlias = Mapping[str, Test]  # last test of each measurement, by name


_HORIZONTAL_VELOCITY = mav.ESTIMATOR_VELOCITY_HORIZ | mav.ESTIMATOR_POS_HORIZ_REL | mav.ESTIMATOR_PRED_POS_HORIZ_REL
_HORIZONTAL_POSITION = mav.ESTIMATOR_POS_HORIZ_ABS | mav.ESTIMATOR_PRED_POS_HORIZ_ABS


class Health(Record, frozen=True):
    """Usable parts of the estimate: roll and pitch to 10°, yaw to 15°, velocity to 1 m/s, position to 5 m.

    Attributes:
        accel_bias, gyro_bias: False for a while after a reset.
    """

    attitude: bool
    heading: bool
    horizontal_velocity: bool
    vertical_velocity: bool
    horizontal_position: bool
    height: bool
    dead_reckoning: bool  # without GPS, position and velocity drift
    gps_lost_since_us: int | None
    gps_glitch: bool  # fixes are received but rejected
    accelerometer: bool
    gyroscope: bool
    accel_bias: bool
    gyro_bias: bool
    not_accepted: tuple[str, ...]  # other sensors without valid values

    @property
    def any_lost(self) -> bool:
        """Whether a sensor has failed."""
        return (
            not (self.accelerometer and self.gyroscope) or bool(self.not_accepted) or self.gps_lost_since_us is not None
        )

    @property
    def flags(self) -> int:
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


class FilterCheck(NamedTuple):
    """The filter at its own time, for consistency checks.

    Attributes:
        nis, accepted: Sum and number of accepted NIS, by kind.
    """

    time_us: int
    state: tuple[float, ...]  # position, velocity (ENU), attitude (wxyz), (10,)
    covariance: tuple[float, ...]  # upper triangle by rows, (45,)
    nis: tuple[float, ...]
    accepted: tuple[int, ...]


class Estimate(Record, frozen=True):
    """The vehicle at one instant; rates without bias, biases FLU (of a modelled force ENU), standard deviations ENU."""

    frame: StateFrame
    position_std_m: Vector
    velocity_std_m_s: Vector
    attitude_std_rad: Vector
    gyro_bias_rad_s: Vector
    accel_bias_m_s2: Vector
    health: Health
    tests: Tests
    rejected: Rejections
    resets: int  # number of resets of a part
    smoothing_m: Vector  # filter minus published position
    check: FilterCheck | None  # ten times a second

    @property
    def speed_known(self) -> bool:
        """Whether the speed is measured: by GPS, or integrated for a while, with heights by the barometer."""
        since_us, unused = self.health.gps_lost_since_us, self.health.not_accepted
        return since_us is None or (
            self.frame.time_us - since_us < _RECKONED_US and RejectedSource.BAROMETER not in unused
        )
