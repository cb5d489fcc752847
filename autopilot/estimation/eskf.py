"""The error-state Kalman filter: state, sensor models, resets.

A measurement rejected for long is accepted by force: the covariance of the measured states is inflated first. For the
magnetic field these are the vehicle's own field, so yaw stays; for pressure the barometer offset, so height stays.
"""

from math import hypot, inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.accelerometer_bias import DetectedBias
from colibri.autopilot.estimation.eskf_predict import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_OFFSET,
    ERRORS,
    GPS_DRIFT,
    GYRO_BIAS,
    HARD_IRON,
    NOMINAL,
    POSITION,
    VELOCITY,
    Noise,
    predict,
)
from colibri.autopilot.estimation.estimate import FilterCheck, Tests
from colibri.autopilot.estimation.measurements.instrument import FIVE_SIGMA, KindRecord, MeasurementKind
from colibri.autopilot.estimation.measurements.table import instruments_of, kinds_of
from colibri.autopilot.estimation.sensing.alignment import Aligned
from colibri.autopilot.estimation.sensing.free_fall import Caught
from colibri.autopilot.estimation.sensing.rejection import Reason
from colibri.common.earth.atmosphere import METRES_PER_PASCAL
from colibri.common.elementary import square
from colibri.common.jit import packed
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import GpsFix
from colibri.plant.vehicle.sensors import Sensors

_FIX_GATES = np.array([FIVE_SIGMA[2], FIVE_SIGMA[1], FIVE_SIGMA[0]])
_FIRST_POSITION_M, _FIRST_VELOCITY_M_S, _FIRST_ATTITUDE_RAD, _FIRST_OFFSET_M = 100.0, 0.02, 0.5, 1000.0
_CAUGHT_M, _CAUGHT_M_S, _CAUGHT_RAD, _CAUGHT_YAW_RAD = 3.0, 1.0, 0.4, 1.0  # deviations at a start in a fall
_ITERATIONS = 4
_UPPER = np.ravel_multi_index(np.triu_indices(9), (ERRORS, ERRORS))  # of position, velocity, attitude
_MIN_NOISE = 1e-6  # lower bound of every noise, in its unit, against division by zero
_PLACE_STEP_M, _HEIGHT_STEP_M, _SPEED_STEP_M_S = 0.011, 0.001, 0.01  # resolutions of HIL_GPS: degE7, mm and cm/s
_CLAIM_STEP_M = 0.01
_IRON_WALK_GAUSS = 1e-5
_SETTLING_US = 10_000_000  # after a start in the air
_UNSURE_PART = 0.3  # uncertainty of the position correction after a bias, as a part of it
_UNSURE_TIMES = 3.0  # inflation of the bias variance, because the velocity correction has the same error
_UNSURE_TURN = 2.0  # the attitude error may exceed the turn of the field, which does not show a turn about itself
_JUMPED_PART = 0.05  # uncertainty of a jump of the gyroscope bias, as a part of it
_UNSURE_S = 0.5  # mean duration of the velocity error
_MODELLED_M_S2, _MODELLED_RAD_S = 2.0, 0.2  # errors of a modelled force, by drag and mass, and of the rate at first
_MISTURNED_RAD = 0.05  # error of the attitude by a gyroscope up to the detection of its failure
_MISLED_RAD, _MISLED_RAD_S = 0.15, 0.02  # errors of attitude and gyroscope bias by a magnetometer that drifts
_SURPRISE = 16.27  # χ² of three degrees of freedom, 0.1 %: the rotors do not explain the change of velocity
_SHORTEST_S = 0.05  # least time in which an unknown force is taken to have acted
_PATIENCE_US = 7_000_000
_INFLATED_M, _INFLATED_M_S = 100.0, 10.0


class FilterRecord(NamedTuple):
    x: Array
    P: Array
    kinds: list[KindRecord]
    accel_bias_us: int | None
    gyro_bias_us: int | None


class Filter:
    """Nominal state x (23,) and covariance P (22, 22), behind the vehicle's time."""

    def __init__(self, sensors: Sensors, gravity_m_s2: float, field_enu_gauss: Vector) -> None:
        self._sensors, self._gravity = sensors, gravity_m_s2
        self._field = np.array(field_enu_gauss)
        self.field_gauss = hypot(*field_enu_gauss)
        self._noise = noise_of(sensors)
        self._packed_noise = packed(self._noise)
        gps = sensors.gps
        self._horizontal = square(gps.horizontal_noise_m) + square(_PLACE_STEP_M) / 12.0
        self._vertical = square(gps.vertical_noise_m) + square(_HEIGHT_STEP_M) / 12.0
        speed = square(gps.velocity_noise_m_s) + square(_SPEED_STEP_M_S) / 12.0
        self._fix, self._fix_y, self._fix_nis = np.zeros(6), np.zeros(6), np.zeros(3)
        self._claims = (nan, nan)
        self._fix_variances = np.array([speed, self._horizontal, self._vertical])
        self.x, self.P = np.zeros(NOMINAL), np.zeros((ERRORS, ERRORS))
        self.velocity = MeasurementKind("velocity", 3, _PATIENCE_US, (VELOCITY, 3, _INFLATED_M_S))
        self.position = MeasurementKind("position", 2, _PATIENCE_US, (POSITION, 2, _INFLATED_M))
        self.height = MeasurementKind("height", 1, _PATIENCE_US, (POSITION + 2, 1, _INFLATED_M))
        self.magnetometer, self.barometer, self.instruments = instruments_of(sensors, field_enu_gauss)
        of_gps, of_others = (self.velocity, self.position, self.height), (one.kind for one in self.instruments)
        by_name = {kind.name: kind for kind in (*of_gps, *of_others)}
        self.kinds = tuple(by_name[name] for name in kinds_of(sensors))
        self.drag = np.zeros(2)  # mean force across the thrust, m/s², east and north
        self.accel_bias_us: int | None = None
        self.gyro_bias_us: int | None = None

    def start(self, aligned: Aligned, place_enu_m: Vector, time_us: int) -> None:
        """Start at rest: means are fused as measurements, so that the covariance holds their correlations.

        The attitude is iterated: a measured tilt may be accelerometer bias, and a covariance linearised at the first
        guess would count as information.
        """
        x, P = self.x, self.P
        attitude = aligned.attitude
        for _ in range(_ITERATIONS):
            self._reset(place_enu_m)
            x[6:10] = attitude
            self._rest(aligned)
            attitude = tuple(x[6:10].tolist())
        for kind in self.kinds:
            kind.accept(time_us)
        y1, y2, y3 = np.zeros(1), np.zeros(2), np.zeros(3)
        place, horizontal, vertical = np.array(place_enu_m), *self._of_place(aligned.fix)
        update.fuse_velocity(x, P, np.array(aligned.fix.velocity_enu_m_s), self._fix_variances[0], inf, y3)
        update.fuse_horizontal(x, P, place, 0.0, horizontal, inf, y2)
        update.fuse_height(x, P, place, 0.0, vertical, inf, y1)
        if aligned.pressure_height_m is not None:
            x[19] = aligned.pressure_height_m - x[2]
            variance = self.barometer.variance / aligned.heights
            update.fuse_pressure_height(x, P, aligned.pressure_height_m, variance, inf, y1)

    def start_in_air(self, caught: Caught, place_enu_m: Vector, time_us: int) -> None:
        x, P = self.x, self.P
        self._reset(place_enu_m)
        x[3:6], x[6:10] = caught.velocity_enu_m_s, caught.attitude
        for first, sigma in ((POSITION, _CAUGHT_M), (VELOCITY, _CAUGHT_M_S), (ATTITUDE, _CAUGHT_RAD)):
            for i in range(first, first + 3):
                P[i, i] = sigma * sigma
        P[ATTITUDE + 2, ATTITUDE + 2] = square(_CAUGHT_YAW_RAD)
        if caught.pressure_height_m is not None:
            x[19] = caught.pressure_height_m - x[2]
        for kind in self.kinds:
            kind.accept(time_us)
        self.magnetometer.doubt_from_us = time_us + _SETTLING_US

    def _reset(self, place_enu_m: Vector) -> None:
        sensors, P = self._sensors, self.P
        self.x[:], P[:] = 0.0, 0.0
        self.x[:3] = place_enu_m
        for first, count, sigma in (
            (POSITION, 3, _FIRST_POSITION_M),
            (VELOCITY, 3, _FIRST_VELOCITY_M_S),
            (ATTITUDE, 3, _FIRST_ATTITUDE_RAD),
            (GYRO_BIAS, 3, max(sensors.gyroscope.turn_on_bias_rad_s, _MIN_NOISE)),
            (ACCEL_BIAS, 3, max(sensors.accelerometer.turn_on_bias_m_s2, _MIN_NOISE)),
            (BARO_OFFSET, 1, _FIRST_OFFSET_M),
            (HARD_IRON, 3, max(sensors.magnetometer.hard_iron_gauss, _MIN_NOISE)),
        ):
            update.inflate_covariance(P, first, count, sigma * sigma)
        for i, variance in enumerate(self._noise.gps_drift):
            P[GPS_DRIFT + i, GPS_DRIFT + i] = variance

    def _rest(self, aligned: Aligned) -> None:
        x, P, noise = self.x, self.P, self._noise
        force, rate = noise.force / aligned.duration_s, noise.rate / aligned.duration_s
        field, y = self.magnetometer.variance / aligned.fields, np.zeros(6)
        mean_force, mean_field = np.array(aligned.force), np.array(aligned.field)
        update.fuse_rest(x, P, mean_force, self._gravity, force, mean_field, self._field, field, y)
        for i in range(3):
            variance = P[GYRO_BIAS + i, GYRO_BIAS + i]
            gain = variance / (variance + rate)
            x[10 + i] = gain * aligned.rate[i]
            P[GYRO_BIAS + i, GYRO_BIAS + i] = gain * rate

    def record(self) -> FilterRecord:
        return FilterRecord(
            self.x, self.P, [kind.record() for kind in self.kinds], self.accel_bias_us, self.gyro_bias_us
        )

    def resume(self, record: FilterRecord) -> bool:
        if (record.x.shape, record.P.shape, len(record.kinds)) != (self.x.shape, self.P.shape, len(self.kinds)):
            return False
        self.x[:], self.P[:] = record.x, record.P
        self.accel_bias_us, self.gyro_bias_us = record.accel_bias_us, record.gyro_bias_us
        for kind, before in zip(self.kinds, record.kinds, strict=True):
            kind.resume(before)
        return True

    def predict(self, samples: Array, row: int) -> None:
        predict(self.x, self.P, samples, row, self._packed_noise, self._gravity)

    def fuse_fix(
        self, fix: GpsFix, place_enu_m: Vector, after_s: float, time_us: int, *, force_modelled: bool = False
    ) -> Reason | None:
        """Fuse a fix measured `after_s` after the filter's time; return a reason if any part is rejected.

        If the force is modelled, a surprising velocity is followed: another force acts, as of the ground.
        """
        x, P, z, y, variances = self.x, self.P, self._fix, self._fix_y, self._fix_variances
        z[:3], z[3:] = place_enu_m, fix.velocity_enu_m_s
        if self.magnetometer.misled:
            self._doubt_attitude()
        claims = (fix.horizontal_accuracy_m, fix.vertical_accuracy_m)
        if claims != self._claims:
            self._claims = claims
            variances[1:] = self._of_place(fix)
        update.fuse_fix(x, P, z, after_s, variances, _FIX_GATES, y, self._fix_nis)
        ve, vn, vu, e, n, u = y.tolist()
        moves, lies, stands = self._fix_nis.tolist()
        accepted = True
        if force_modelled and moves > _SURPRISE:
            moves = self._follow(time_us, z[3:])
        if not self.velocity.note(time_us, (ve, vn, vu), moves):
            accepted &= self.velocity.force_accept(x, P, time_us, update.fuse_velocity, z[3:], variances[0])
        if not self.position.note(time_us, (e, n), lies):
            accepted &= self.position.force_accept(x, P, time_us, update.fuse_horizontal, z[:3], after_s, variances[1])
        if self.height.note(time_us, (u,), stands):
            self.barometer.height_known_us = time_us
        else:
            accepted &= self.height.force_accept(x, P, time_us, update.fuse_height, z[:3], after_s, variances[2])
        return None if accepted else Reason.INNOVATION

    def _follow(self, time_us: int, velocity: Array) -> float:
        """Fuse a velocity as the effect of an unknown force since the last accepted one; return its NIS."""
        x, P = self.x, self.P
        since_s = (time_us - self.velocity.accepted_us) * 1e-6
        squared = square(float(np.abs(velocity - x[3:6]).max()))
        update.inflate_covariance(P, VELOCITY, 3, squared)
        update.inflate_covariance(P, ACCEL_BIAS, 3, squared / square(max(since_s, _SHORTEST_S)))
        return update.fuse_velocity(x, P, velocity, self._fix_variances[0], inf, np.zeros(3))

    def reset_accel_bias(self, found: DetectedBias, time_us: int) -> None:
        """Correct the bias, and the position and velocity errors since its change."""
        x, P = self.x, self.P
        x[:3] += found.position_m
        x[3:6] += found.velocity_m_s
        x[13:16] += found.bias_m_s2
        moved_m = _UNSURE_PART * float(np.abs(found.position_m).max())
        update.inflate_covariance(P, POSITION, 3, moved_m * moved_m)
        update.inflate_covariance(P, VELOCITY, 3, self._fix_variances[0])
        update.inflate_covariance(P, ACCEL_BIAS, 3, _UNSURE_TIMES * found.variance)
        self.velocity.reset(time_us)
        self.accel_bias_us = time_us

    def replace_force(self, *, modelled: bool) -> None:
        """Forget the bias of the accelerometer for that of the model, or the reverse, and what it led astray."""
        self._forget_bias(ACCEL_BIAS, _MODELLED_M_S2 if modelled else self._sensors.accelerometer.turn_on_bias_m_s2)
        if modelled:
            self.x[13:15] = -self.drag
            self._doubt_motion()
            update.inflate_covariance(self.P, POSITION + 2, 1, square(self.barometer.kind.test.innovation[0]))

    def replace_rate(self, *, modelled: bool) -> None:
        """Forget the bias of the gyroscope for that of the model, or the reverse."""
        self._forget_bias(GYRO_BIAS, _MODELLED_RAD_S if modelled else self._sensors.gyroscope.turn_on_bias_rad_s)
        if modelled:
            update.inflate_covariance(self.P, ATTITUDE, 3, square(_MISTURNED_RAD))

    def _forget_bias(self, first: int, sigma: float) -> None:
        self.x[first + 1 : first + 4] = 0.0
        self.P[first : first + 3, :] = self.P[:, first : first + 3] = 0.0
        update.inflate_covariance(self.P, first, 3, square(max(sigma, _MIN_NOISE)))

    def reset_gyro_bias(self, turned_rad: float, since_s: float, time_us: int) -> None:
        """Inflate the covariance after a gyroscope fault that turned the field by `turned_rad` in `since_s`.

        If the field is rather late, return to an older bias instead.
        """
        if self.magnetometer.convict(self.x, self.P, time_us):
            return
        P, angle_rad = self.P, _UNSURE_TURN * turned_rad
        update.inflate_covariance(P, ATTITUDE, 3, angle_rad * angle_rad)
        update.inflate_covariance(P, GYRO_BIAS, 3, square(angle_rad / since_s))
        speed_m_s = hypot(*self.velocity.test.innovation)
        update.inflate_covariance(P, POSITION, 3, square(_UNSURE_S * speed_m_s))
        update.inflate_covariance(P, VELOCITY, 3, speed_m_s * speed_m_s)
        self.velocity.reset(time_us)
        self.magnetometer.kind.accept(self.magnetometer.kind.test.time_us)
        self.gyro_bias_us = time_us

    def jump_gyro_bias(self, bias: Vector, misturned_s: float, time_us: int) -> None:
        """Add to the gyroscope bias, rad/s, by which the attitude has been turned for `misturned_s`."""
        self.x[10:13] += bias
        size = hypot(*bias)
        update.inflate_covariance(self.P, GYRO_BIAS, 3, square(_JUMPED_PART * size))
        update.inflate_covariance(self.P, ATTITUDE, 3, square(size * misturned_s))
        self.gyro_bias_us = time_us

    def _doubt_attitude(self) -> None:
        """Let GPS velocity find the attitude anew after a drift of the magnetometer."""
        self.magnetometer.misled = False
        update.inflate_covariance(self.P, ATTITUDE, 3, square(_MISLED_RAD))
        update.inflate_covariance(self.P, GYRO_BIAS, 3, square(_MISLED_RAD_S))
        self._doubt_motion()

    def _doubt_motion(self) -> None:
        """Inflate velocity and position by what GPS contradicts."""
        for axis, error_m_s in enumerate(self.velocity.test.innovation):
            update.inflate_covariance(self.P, POSITION + axis, 1, square(_UNSURE_S * error_m_s))
            update.inflate_covariance(self.P, VELOCITY + axis, 1, square(error_m_s))

    def check(self, time_us: int) -> FilterCheck:
        upper = self.P.take(_UPPER).tolist()
        nis, accepted = tuple(kind.nis for kind in self.kinds), tuple(kind.accepted for kind in self.kinds)
        return FilterCheck(time_us, tuple(self.x[:10].tolist()), tuple(upper), nis, accepted)

    @property
    def tests(self) -> Tests:
        return {kind.name: kind.test for kind in self.kinds}

    @property
    def resets(self) -> int:
        return sum(kind.resets for kind in self.kinds)

    def _of_place(self, fix: GpsFix) -> tuple[float, float]:
        drift = self._noise.gps_drift
        return (
            self._horizontal + _excess(fix.horizontal_accuracy_m, self._horizontal + drift[0]),
            self._vertical + _excess(fix.vertical_accuracy_m, self._vertical + drift[2]),
        )


def noise_of(sensors: Sensors) -> Noise:
    accel, gyro, gps, barometer = sensors.accelerometer, sensors.gyroscope, sensors.gps, sensors.barometer
    horizontal, vertical = (square(max(sigma, _MIN_NOISE)) for sigma in (gps.horizontal_drift_m, gps.vertical_drift_m))
    drift_m = max(barometer.drift_pa * METRES_PER_PASCAL, _MIN_NOISE)
    return Noise(
        force=square(max(accel.noise_density_m_s2_rthz, _MIN_NOISE)),
        rate=square(max(gyro.noise_density_rad_s_rthz, _MIN_NOISE)),
        gyro_bias=square(max(gyro.bias_walk_rad_s2_rthz, _MIN_NOISE)),
        accel_bias=square(max(accel.bias_walk_m_s3_rthz, _MIN_NOISE)),
        gps_drift=(horizontal, horizontal, vertical),
        gps_drift_time_s=gps.drift_time_s,
        baro_offset=2.0 * square(drift_m) / barometer.drift_time_s,
        hard_iron=square(_IRON_WALK_GAUSS),
    )


def _excess(claimed_m: float, described: float) -> float:
    """Return the excess of a reported variance, rounded to cm on the wire, over the described one."""
    return max(0.0, square(max(claimed_m - 0.5 * _CLAIM_STEP_M, 0.0)) - described) if isfinite(claimed_m) else 0.0
