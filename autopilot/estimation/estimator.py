"""The estimator: sensor frames in, current state and accuracy out."""

from functools import reduce
from math import ceil, isfinite
from operator import or_
from typing import NamedTuple

import numpy as np

from colibri.autopilot.estimation.accelerometer_bias import AccelerometerWatch
from colibri.autopilot.estimation.delay_buffer import DelayBuffer, Waiting
from colibri.autopilot.estimation.eskf import Filter, FilterRecord
from colibri.autopilot.estimation.eskf_predict import look_ahead
from colibri.autopilot.estimation.estimate import Estimate, FilterCheck, Health, Tests
from colibri.autopilot.estimation.inertial_watch import InertialWatch, turned_since
from colibri.autopilot.estimation.measurements.instrument import FusedInstrument, Value
from colibri.autopilot.estimation.output_smoothing import OutputSmoothing
from colibri.autopilot.estimation.sensing.alignment import Aligned, Alignment
from colibri.autopilot.estimation.sensing.free_fall import Falling
from colibri.autopilot.estimation.sensing.inertial import Expected, Inertial, InertialReading
from colibri.autopilot.estimation.sensing.plausibility import MAX_GAP_US, ClockResets, GpsWatch
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected, RejectedSource
from colibri.common.earth.atmosphere import altitude_m
from colibri.common.earth.compiled_geodesy import enu_of
from colibri.common.earth.geodesy import Geodetic
from colibri.common.earth.magnetic_field import field_enu_gauss
from colibri.common.serialization import of_bytes, to_bytes
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame
from colibri.mavlink.hil.state import StateFrame
from colibri.plant.vehicle.sensors import Sensors

_SPARE_SAMPLES = 8
_LATE_US = 1_000_000  # a sensor is lost this long after its last accepted measurement
_LEARNING_US = 5_000_000  # a bias counts as not yet learned this long after its reset
_MAX_FIX_AGE_S = 0.5  # largest distance of a fix from the filter's time
_KNOWN_TILT_RAD, _KNOWN_YAW_RAD = 0.17, 0.26
_KNOWN_M_S = 1.0
_KNOWN_M = 5.0
_MAX_SPEED_M_S = 500.0
_CHECK_EVERY_US, _CHECK_AT_US = 100_000, 50_000  # between two fixes, because frames with a fix have enough work
_NOTHING = InertialReading((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, False)


class EstimatorRecord(NamedTuple):
    time_us: int
    filter_us: int
    filter: FilterRecord
    samples: Array
    first: int
    waiting: list[Waiting]
    reading: InertialReading
    fix_us: int | None
    position_m: Vector
    velocity_m_s: Vector


class Estimator:
    """Estimates the state of one vehicle; `caught` if it started in a fall."""

    def __init__(self, sensors: Sensors, gravity_m_s2: float, origin: Geodetic, interval_us: int) -> None:
        self._sensors, self._gravity, self._origin = sensors, gravity_m_s2, origin
        self._interval_us = interval_us
        self._field = field_enu_gauss(origin)
        self._delay_us = round(sensors.gps.delay_s * 1e6)
        self._capacity = ceil(self._delay_us / interval_us) + _SPARE_SAMPLES
        self._now = np.zeros(19)
        self._rejected = Rejected()
        self._restart()
        self._warm_up()
        self._rejected = Rejected()
        self._restart()

    def _restart(self) -> None:
        sensors = self._sensors
        self._inertial = Inertial(sensors, self._rejected)
        self._gps_watch = GpsWatch(sensors.gps)
        self._falling = Falling(self._gravity, self._field, sensors.gps.delay_s)
        self.caught = False
        self._alignment = Alignment(sensors, self._gravity, self._field, self._interval_us * 1e-6)
        self.filter = Filter(sensors, self._gravity, self._field)
        instruments = self.filter.instruments
        self._reads = [instrument.read for instrument in instruments]
        self._groups = reduce(or_, (instrument.group for instrument in instruments))
        self._at_rest: list[Value | None] = [None] * len(instruments)
        self._reads_messages = not all(instrument.group for instrument in instruments)
        self._accelerometer_watch = AccelerometerWatch(sensors, self._gravity)
        self._output_smoothing = OutputSmoothing()
        self._clock_resets = ClockResets()
        self._buffer = DelayBuffer(self._capacity)
        self.filter_us = 0
        self._reading = _NOTHING
        self._queued: SensorFrame | None = None
        self._unpublished = False
        self._time_us: int | None = None
        self._published_us = 0
        self._estimate: Estimate | None = None
        self._tests: Tests | None = None
        self._resets = 0
        self._inertial_watch = InertialWatch(self._inertial, sensors, self.filter.field_gauss)

    @property
    def last(self) -> Estimate | None:
        return self._estimate

    def step(self, frame: SensorFrame) -> Estimate | None:
        self.receive(frame)
        return self.estimate()

    def receive(self, frame: SensorFrame) -> None:
        """Queue a frame until the next call; the first estimate and stray frames are handled at once for `last`."""
        self.advance()
        self._queued = frame
        last_us = self._time_us
        if self._estimate is None or last_us is None or not 0 < frame.time_us - last_us <= MAX_GAP_US:
            self.advance()

    def estimate(self) -> Estimate | None:
        """Return the estimate; a stray frame repeats the previous one, a series of them restarts."""
        self.advance()
        if self._unpublished and self._time_us is not None:
            self._publish(self._time_us)
        return self._estimate

    def advance(self) -> None:
        frame, self._queued = self._queued, None
        if frame is not None:
            self._take_in(frame)

    def settle(self) -> None:
        """Advance, and precompute the work of the next frame."""
        self.advance()
        if self._estimate is not None and self._time_us is not None:
            self._take_until(self._time_us + self._interval_us)
            self._note_tests()

    def _take_in(self, frame: SensorFrame) -> None:
        last_us = self._time_us
        if last_us is not None and not 0 < frame.time_us - last_us <= MAX_GAP_US:
            self._rejected.add(RejectedSource.CLOCK, Reason.TIME)
            if not self._clock_resets.settle(frame.time_us):
                self._unpublished = False
                return
            self._restart()
            last_us = None
        self._clock_resets.clear()
        self._time_us = frame.time_us
        before, self._reading = self._reading, self._inertial.read(frame)
        if self._estimate is not None:
            self._replace(before)
        rejected = self._rejected
        reads = frame.updated & self._groups or self._reads_messages
        values = [read(frame, rejected) for read in self._reads] if reads else None
        fix = frame.gps
        if fix is not None and not self._gps_watch.accepts(fix, frame.time_us, rejected):
            fix = None
        if self._estimate is None or last_us is None:
            at_rest = self._field_and_height(values)
            if values is not None:
                self._at_rest = [new or old for new, old in zip(values, self._at_rest, strict=True)]
            aligned = self._alignment.feed(frame.time_us, self._reading, *at_rest, fix)
            caught = self._falling.feed(frame.time_us, self._reading, *at_rest, fix)
            if aligned is not None:
                self._start(aligned, frame.time_us)
            elif caught is not None:
                self.caught = True
                (e, n, u), (de, dn, du) = enu_of(caught.fix.place, self._origin), caught.moved_m
                self.filter.start_in_air(caught, (e + de, n + dn, u + du), frame.time_us)
            else:
                return
            self._published_us = self.filter_us = frame.time_us
        else:
            buffer = self._buffer
            if len(buffer.waiting) == len(buffer.samples):
                self._take(frame.time_us)
            interval_s = (frame.time_us - last_us) * 1e-6
            buffer.put(before, self._reading, interval_s, Waiting(frame.time_us, values))
            self._inertial_watch.look_for_jump(buffer, self.filter, before, self._reading, interval_s)
            self._take_until(frame.time_us)
            if fix is not None:
                self._fuse(fix, frame.time_us)
        self._unpublished = True
        if self._estimate is None:
            self._publish(frame.time_us)

    def record(self) -> bytes:
        self.advance()
        if self._estimate is None or self._time_us is None:
            return b""
        return to_bytes(
            EstimatorRecord(
                self._time_us,
                self.filter_us,
                self.filter.record(),
                self._buffer.samples,
                self._buffer.first,
                list(self._buffer.waiting),
                self._reading,
                self._gps_watch.time_us,
                self._output_smoothing.position_m,
                self._output_smoothing.velocity_m_s,
            )
        )

    def resume(self, record: bytes, time_us: int) -> bool:
        """Restore a record; return whether it fits. A frame without an answer is received again."""
        kept, buffer = of_bytes(EstimatorRecord, record), self._buffer
        if kept is None or not 0 <= time_us - kept.time_us <= MAX_GAP_US or kept.samples.shape != buffer.samples.shape:
            return False
        if not self.filter.resume(kept.filter):
            return False
        buffer.samples[:], buffer.first = kept.samples, kept.first
        buffer.waiting.clear()
        buffer.waiting.extend(kept.waiting)
        self.filter_us, self._reading, self._gps_watch.time_us = kept.filter_us, kept.reading, kept.fix_us
        self._output_smoothing.position_m, self._output_smoothing.velocity_m_s = kept.position_m, kept.velocity_m_s
        self._time_us = self._published_us = kept.time_us
        if self._publish(kept.time_us) is None:
            return False
        if time_us == kept.time_us and buffer.waiting:
            buffer.waiting.pop()
            self._time_us -= self._interval_us
        return True

    def _field_and_height(self, values: list[Value | None] | None) -> tuple[Vector | None, float | None]:
        if values is None:
            return None, None
        field, pressure, *_ = values
        height_m = None if pressure is None else altitude_m(pressure[0])
        return None if field is None else (field[0], field[1], field[2]), height_m

    def _start(self, aligned: Aligned, time_us: int) -> None:
        self.filter.start(aligned, enu_of(aligned.fix.place, self._origin), time_us)
        for instrument, value in zip(self.filter.instruments, self._at_rest, strict=True):
            if instrument.smoothed and value is not None:
                instrument.fuse(self.filter.x, self.filter.P, value, time_us)

    def _take_until(self, now_us: int) -> None:
        waiting, before_us = self._buffer.waiting, now_us - self._delay_us
        while waiting and waiting[0].time_us <= before_us:
            self._take(now_us)

    def _take(self, now_us: int) -> None:
        filter_ = self.filter
        filter_.predict(self._buffer.samples, self._buffer.first)
        taken = self._buffer.take()
        time_us, values = taken.time_us, taken.values
        self.filter_us = time_us
        if values is None:
            return
        self._tests = None
        for instrument, value in zip(filter_.instruments, values, strict=True):
            if value is not None:
                self._fuse_value(instrument, value, time_us, now_us)

    def _fuse_value(self, instrument: FusedInstrument, value: Value, time_us: int, now_us: int) -> None:
        x = self.filter.x
        before = x[:6].tolist() if instrument.smoothed else None
        reason = instrument.fuse(x, self.filter.P, value, time_us)
        if reason is not None:
            self._rejected.add(instrument.source, reason)
        elif before is not None:
            self._output_smoothing.absorb(before, x[:6].tolist(), (now_us - time_us) * 1e-6)

    def _fuse(self, fix: GpsFix, now_us: int) -> None:
        after_s = (fix.time_us - self._delay_us - self.filter_us) * 1e-6
        if abs(after_s) > _MAX_FIX_AGE_S:
            self._rejected.add(RejectedSource.GPS, Reason.TIME)
            return
        self._tests = None
        before = self.filter.x[:10].tolist()
        modelled = self._reading
        place_enu_m = enu_of(fix.place, self._origin)
        reason = self.filter.fuse_fix(fix, place_enu_m, after_s, now_us, force_modelled=modelled.force_modelled)
        if reason is not None:
            self._rejected.add(RejectedSource.GPS, reason)
        self._output_smoothing.absorb(before[:6], self.filter.x[:6].tolist(), (now_us - self.filter_us) * 1e-6)
        if modelled.force_modelled:
            self._output_smoothing.follow()
        found = self._accelerometer_watch.look(fix.time_us, before, self.filter.velocity, self.filter.barometer)
        if found is not None and not (modelled.force_modelled or modelled.rate_modelled):
            self.filter.reset_accel_bias(found, now_us)
            self._inertial_watch.look_at_bias(float(np.abs(self.filter.x[13:16]).max()))
        turned = turned_since(self.filter, now_us)
        if turned is not None and not modelled.rate_modelled:
            self.filter.reset_gyro_bias(*turned, now_us)

    def _publish(self, now_us: int) -> Estimate | None:
        self._unpublished = False
        filter_, buffer = self.filter, self._buffer
        ahead = len(buffer.waiting)
        look_ahead(filter_.x, filter_.P, buffer.samples, buffer.first, ahead, self._gravity, self._now)
        e, n, u, ve, vn, vu, qw, qx, qy, qz, *sigma = self._now.tolist()
        se, sn, su, sve, svn, svu, roll, pitch, yaw = sigma
        if not isfinite(sum(sigma) + e + n + u + qw) or not abs(ve) + abs(vn) + abs(vu) < _MAX_SPEED_M_S:
            self._restart()
            return None
        (de, dn, du), (dve, dvn, dvu) = self._output_smoothing.position_m, self._output_smoothing.velocity_m_s
        since_us = now_us - self._published_us
        self._published_us = now_us
        self._output_smoothing.give_in(since_us * 1e-6)
        bx, by, bz, ax, ay, az = filter_.x[10:16].tolist()
        reading = self._reading
        p, q, r = reading.rate if reading.rate_good or reading.rate_modelled else (bx, by, bz)
        tests = self._note_tests()
        self._estimate = Estimate(
            StateFrame(
                now_us,
                (e + de, n + dn, u + du),
                (ve + dve, vn + dvn, vu + dvu),
                (qw, qx, qy, qz),
                (p - bx, q - by, r - bz),
            ),
            (se, sn, su),
            (sve, svn, svu),
            (roll, pitch, yaw),
            (bx, by, bz),
            (ax, ay, az),
            self._health(now_us, sigma),
            tests,
            self._rejected.counts,
            self._resets,
            (-de, -dn, -du),
            self._check(now_us, since_us),
        )
        return self._estimate

    def _note_tests(self) -> Tests:
        if self._tests is None:
            self._tests, self._resets = self.filter.tests, self.filter.resets
        return self._tests

    def _check(self, now_us: int, since_us: int) -> FilterCheck | None:
        at_us = now_us - _CHECK_AT_US
        if at_us // _CHECK_EVERY_US == (at_us - since_us) // _CHECK_EVERY_US:
            return None
        self._inertial_watch.look(self._buffer, self.filter, now_us, rate_known=self._reading.rate_good)
        return self.filter.check(self.filter_us)

    def _replace(self, before: InertialReading) -> None:
        reading = self._reading
        if reading.force_modelled != before.force_modelled:
            self.filter.replace_force(modelled=reading.force_modelled)
        if reading.rate_modelled != before.rate_modelled:
            self.filter.replace_rate(modelled=reading.rate_modelled)

    @property
    def shaken(self) -> bool:
        return self._inertial.shaken

    def expect(self, expected: Expected | None) -> None:
        """Set the motion that the rotors cause, for inertial sensors that have failed."""
        self._inertial.expected = expected

    def trust_inertial(self) -> None:
        """Use inertial sensors again that have failed."""
        self._inertial_watch.trust()

    def _health(self, now_us: int, sigma: list[float]) -> Health:
        filter_, reading = self.filter, self._reading
        position_us, velocity_us = filter_.position.accepted_us, filter_.velocity.accepted_us
        accepted_us = min(position_us, velocity_us)
        lost = now_us - accepted_us > _LATE_US
        late_us = self.filter_us - _LATE_US
        not_accepted = [one.source for one in filter_.instruments if one.kind.accepted_us < late_us]
        return Health(
            (reading.rate_good or reading.rate_modelled) and max(sigma[6:8]) <= _KNOWN_TILT_RAD,
            sigma[8] <= _KNOWN_YAW_RAD,
            sigma[3] <= _KNOWN_M_S and sigma[4] <= _KNOWN_M_S,
            sigma[5] <= _KNOWN_M_S,
            sigma[0] <= _KNOWN_M and sigma[1] <= _KNOWN_M,
            sigma[2] <= _KNOWN_M,
            now_us - max(position_us, velocity_us) > _LATE_US,
            accepted_us if lost else None,
            filter_.position.rejected_us is not None or filter_.velocity.rejected_us is not None,
            reading.force_good,
            reading.rate_good,
            filter_.accel_bias_us is None or now_us - filter_.accel_bias_us > _LEARNING_US,
            filter_.gyro_bias_us is None or now_us - filter_.gyro_bias_us > _LEARNING_US,
            tuple(not_accepted) if not_accepted else (),
        )

    def _warm_up(self) -> None:
        fix = GpsFix(0, 3, self._origin, (0.0, 0.0, 0.0), 1.0, 1.0, 10)
        force = (0.0, 0.0, self._gravity)
        aligned = Aligned(1.0, force, (0.0, 0.0, 0.0), self._field, 50, 0.0, 50, fix, (1.0, 0.0, 0.0, 0.0))
        self.filter.start(aligned, (0.0, 0.0, 0.0), 0)
        rest = InertialReading(force, (0.0, 0.0, 0.0), True, True)
        typical: list[Value | None] = [instrument.typical() for instrument in self.filter.instruments]
        self._buffer.put(rest, self._reading, self._interval_us * 1e-6, Waiting(self._interval_us, typical))
        self._take(self._interval_us)
        self._fuse(fix, self._interval_us)
        self._publish(self._interval_us)
        self._inertial_watch.look(self._buffer, self.filter, self._interval_us, rate_known=True)
