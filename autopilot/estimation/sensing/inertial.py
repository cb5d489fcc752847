"""Inertial samples from frames."""

from math import inf
from typing import TypeAlias

from colibri.autopilot.estimation.eskf_predict import MODELLED, UNKNOWN
from colibri.autopilot.estimation.sensing.plausibility import Watch
from colibri.autopilot.estimation.sensing.rejection import Rejected, RejectedSource
from colibri.common.records import Record
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import SensorFrame, Updated
from colibri.plant.vehicle.sensors import Sensors

Expected: TypeAlias = tuple[float, float, float, float, float, float]  # of a `MODELLED` force; turn, rad/s², FLU
Sample = tuple[float, ...]  # columns of `eskf_predict.SAMPLE`

_BEYOND_RANGE = 1.01  # tolerance for resolution at the end of the range
_BRIDGED_US = 20_000  # validity of the last good value when values are missing
_FROZEN_US = 12_000  # the same when it is repeated, though it has noise: a frozen turn would be flown against
_NOISY_1_S = 10.0  # bandwidth at which the model follows a noisy gyroscope
_NOISE_RAD_S = 0.5  # difference beyond which a noisy gyroscope counts no more: the larger the noise, the slower
_MAX_STEP_S = 0.02
# A sensor without values for so long, and in so many frames, has failed: those that come later may be as late.
_FAILED_M_S2_US, _FAILED_RAD_S_US, _FAILED_FRAMES = 45_000, 15_000, 4


class InertialSensor:
    """One of the two sensors; one that has `failed`, or is `noisy` beside, stays so until it is trusted again."""

    def __init__(self, source: RejectedSource, group: int, maximum: float, noise: float, failed_us: int) -> None:
        self._group, self._failed_us = group, failed_us
        maximum *= _BEYOND_RANGE
        self._watch = Watch(source, -maximum, maximum, _FROZEN_US if noise > 0.0 else inf)
        self._may_repeat = noise == 0.0
        self._frames_without = 0  # a new value, in a row
        self.time_us: int | None = None
        self.value: Vector = (0.0, 0.0, 0.0)
        self.failed = self.noisy = False

    def read(self, frame: SensorFrame, value: Vector, rejected: Rejected) -> bool:
        accepted = frame.updated & self._group == self._group and self._watch.accepts(value, frame.time_us, rejected)
        if accepted and (self._watch.is_new or self._may_repeat):
            self.value, self.time_us, self._frames_without = value, frame.time_us, 0
            return not self.failed
        if self.time_us is None:
            return False
        self._frames_without += 1
        late_us = frame.time_us - self.time_us
        self.failed |= late_us > self._failed_us and self._frames_without >= _FAILED_FRAMES
        return late_us <= (_FROZEN_US if accepted else _BRIDGED_US) and not self.failed


class InertialReading(Record, frozen=True):
    """Inertial values, m/s² and rad/s, FLU, whether each is usable, and whether it is modelled."""

    force: Vector
    rate: Vector
    force_good: bool
    rate_good: bool
    force_modelled: bool = False
    rate_modelled: bool = False


class Inertial:
    """Reads both sensors; `expected` by the rotors takes the place of one that has failed."""

    def __init__(self, sensors: Sensors, rejected: Rejected) -> None:
        accel, gyro = sensors.accelerometer, sensors.gyroscope
        self._rejected = rejected
        self.expected: Expected | None = None
        self._turns: tuple[int, Vector] | None = None
        self.shaken = False
        self.accelerometer = InertialSensor(
            *(RejectedSource.ACCELEROMETER, Updated.ACCELEROMETER, accel.range_m_s2),
            *(accel.noise_density_m_s2_rthz, _FAILED_M_S2_US),
        )
        self.gyroscope = InertialSensor(
            *(RejectedSource.GYROSCOPE, Updated.GYROSCOPE, gyro.range_rad_s),
            *(gyro.noise_density_rad_s_rthz, _FAILED_RAD_S_US),
        )

    def suspect_rates(self, before_us: int, before: Vector, *, shaken: bool) -> None:
        """Let the model run beside a gyroscope while it shakes, from the rate before it, rad/s FLU, on."""
        if shaken:
            self._turns = before_us, before
        self.shaken = shaken

    def doubt_rates(self, rate: Vector | None = None) -> None:
        """Let the model follow the gyroscope, which has become noisy, from a rate, rad/s FLU, or where it is, on."""
        gyroscope = self.gyroscope
        if gyroscope.time_us is not None and not gyroscope.failed:
            gyroscope.failed = gyroscope.noisy = True
            if rate is not None:
                self._turns = gyroscope.time_us, rate

    def read(self, frame: SensorFrame) -> InertialReading:
        force_good = self.accelerometer.read(frame, frame.specific_force_flu_m_s2, self._rejected)
        rate_good = self.gyroscope.read(frame, frame.rate_flu_rad_s, self._rejected)
        reading = InertialReading(self.accelerometer.value, self.gyroscope.value, force_good, rate_good)
        if rate_good and not self.shaken:
            self._turns = None
            if force_good:
                self.expected = None
        if self.expected is None:
            return reading
        across, along, thrust_m_s2, *turn = self.expected
        if not force_good:
            reading = reading._replace(force=(across, along, thrust_m_s2), force_modelled=True)
        if not rate_good or self.shaken:
            before_us, (p, q, r) = self._turns or (self.gyroscope.time_us or frame.time_us, reading.rate)
            dt = min((frame.time_us - before_us) * 1e-6, _MAX_STEP_S)
            rate = (p + turn[0] * dt, q + turn[1] * dt, r + turn[2] * dt)
            if self.gyroscope.noisy:
                part = min(_NOISY_1_S * dt, 1.0)
                p, q, r = (
                    old + part * max(-_NOISE_RAD_S, min(new - old, _NOISE_RAD_S))
                    for old, new in zip(rate, self.gyroscope.value, strict=True)
                )
                rate = (p, q, r)
            self._turns = frame.time_us, rate
            if not rate_good:
                reading = reading._replace(rate=rate, rate_modelled=True)
        return reading


def sample_between(before: InertialReading, now: InertialReading, interval_s: float) -> Sample:
    """Return the sample between two frames (trapezoidal rule)."""
    (ax, ay, az), (bx, by, bz) = before.force, now.force
    (ap, aq, ar), (bp, bq, br) = before.rate, now.rate
    return (
        interval_s,
        0.5 * (ax + bx),
        0.5 * (ay + by),
        0.5 * (az + bz),
        0.5 * (ap + bp),
        0.5 * (aq + bq),
        0.5 * (ar + br),
        0.0 if before.force_good and now.force_good else _blind(before.force_modelled and now.force_modelled),
        0.0 if before.rate_good and now.rate_good else _blind(before.rate_modelled and now.rate_modelled),
    )


def _blind(modelled: bool) -> float:
    return MODELLED if modelled else UNKNOWN
