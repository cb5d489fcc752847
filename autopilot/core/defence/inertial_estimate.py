"""The state after an exception in the estimator: gyroscope and accelerometer, with the barometer for height.

A complementary filter: R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE TAC 53(5), 2008. The mean specific force of a level
vehicle points up. Position is unknown; the horizontal velocity is integrated with a leak.
"""

from math import isfinite, sqrt

from colibri.autopilot.core.defence import table
from colibri.autopilot.core.defence.errors import Defence
from colibri.autopilot.estimation.estimate import Estimate
from colibri.autopilot.estimation.state_source import StateSource
from colibri.common.earth.atmosphere import altitude_m
from colibri.common.rotations import earth_from_body, normalized, quaternion_product, rotation_matrix
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.sensors import Frame, SensorFrame, Updated
from colibri.mavlink.hil.state import StateFrame

_UPRIGHT_1_S = 0.05
_FORGET_1_S = 0.15
_HEIGHT_1_S, _CLIMB_1_S2 = 2.0, 1.0
_MAX_STEP_S = 0.1
_STEADY = (0.7, 1.3)  # parts of gravity: the specific forces that show the vertical
_BRIDGED = 5  # frames in a row after which the position counts as unknown
_MAX_ERRORS = 50  # exceptions after which the estimator is not asked again
_UNKNOWN_M = 1e3


class InertialEstimate:
    """The state of one vehicle, from the last estimate on."""

    def __init__(self, estimate: Estimate, gravity_m_s2: float) -> None:
        self.frame = estimate.frame  # the present state
        self._gravity = gravity_m_s2
        self._gyro_bias, self._accel_bias = estimate.gyro_bias_rad_s, estimate.accel_bias_m_s2
        self._rate = estimate.frame.rate_flu_rad_s
        self._force: Vector | None = None
        self._pressure_us: int | None = None
        self._above_m = 0.0

    def step(self, frame: SensorFrame) -> StateFrame:
        before = self.frame
        interval_s = min(max((frame.time_us - before.time_us) * 1e-6, 0.0), _MAX_STEP_S)
        self._rate = _read(frame, Updated.GYROSCOPE, frame.rate_flu_rad_s, self._gyro_bias) or self._rate
        force = _read(frame, Updated.ACCELEROMETER, frame.specific_force_flu_m_s2, self._accel_bias)
        self._force = force or self._force
        attitude = turned(before.attitude, self._upright(before.attitude), interval_s)
        x, y, z = before.position_enu_m
        vx, vy, vz = before.velocity_enu_m_s
        if self._force is not None:
            ax, ay, az = earth_from_body(attitude, self._force)
            kept = 1.0 - _FORGET_1_S * interval_s
            vx, vy = (vx + ax * interval_s) * kept, (vy + ay * interval_s) * kept
            vz += (az - self._gravity) * interval_s
        z, vz = self._by_pressure(frame, z + vz * interval_s, vz)
        place = (x + vx * interval_s, y + vy * interval_s, z)
        self.frame = StateFrame(frame.time_us, place, (vx, vy, vz), attitude, self._rate)
        return self.frame

    def _upright(self, attitude: Quaternion) -> Vector:
        """Return the rates with the correction towards the measured vertical, rad/s."""
        p, q, r = self._rate
        if self._force is None:
            return p, q, r
        fx, fy, fz = self._force
        size = sqrt(fx * fx + fy * fy + fz * fz)
        if not _STEADY[0] < size / self._gravity < _STEADY[1]:
            return p, q, r
        ux, uy, uz = rotation_matrix(attitude)[2]
        k = _UPRIGHT_1_S / size
        return p + k * (fy * uz - fz * uy), q + k * (fz * ux - fx * uz), r + k * (fx * uy - fy * ux)

    def _by_pressure(self, frame: SensorFrame, z: float, climb_m_s: float) -> tuple[float, float]:
        if not frame.has(Updated.BAROMETER) or not 0.0 < frame.pressure_pa < 2e5:
            return z, climb_m_s
        height_m, before_us, self._pressure_us = altitude_m(frame.pressure_pa), self._pressure_us, frame.time_us
        if before_us is None:
            self._above_m = z - height_m
        interval_s = 0.0 if before_us is None else min((frame.time_us - before_us) * 1e-6, _MAX_STEP_S)
        error_m = height_m + self._above_m - z
        return z + _HEIGHT_1_S * interval_s * error_m, climb_m_s + _CLIMB_1_S2 * interval_s * error_m


def turned(attitude: Quaternion, rate: Vector, interval_s: float) -> Quaternion:
    """Return an attitude after a short turn at body rates, rad/s, to the second order."""
    p, q, r = (0.5 * interval_s * each for each in rate)
    return normalized(quaternion_product(attitude, (1.0, p, q, r)))


def _read(frame: SensorFrame, group: int, value: Vector, bias: Vector) -> Vector | None:
    if not frame.has(group) or not all(map(isfinite, value)):
        return None
    x, y, z = value
    return x - bias[0], y - bias[1], z - bias[2]


class StateEstimates:
    def __init__(self, source: StateSource, defence: Defence, gravity_m_s2: float) -> None:
        self._source, self._defence, self._gravity = source, defence, gravity_m_s2
        self._inertial: InertialEstimate | None = None
        self._missed = 0
        self.blind = False  # whether the state comes from the inertial sensors alone, without position

    def state(self, frame: Frame, *, now: bool) -> StateFrame | None:
        """Return the state at a frame, or with `now` false at the frame before; None before the first estimate."""
        guard, source = self._defence.guard, self._source
        if not self.blind:
            worked, known = guard(table.ESTIMATOR, self._estimated, lambda: (False, None), frame, now)
            if worked:
                self._inertial, self._missed = None, 0
                return known
        if isinstance(frame, StateFrame):
            return frame
        last = None if source.estimate is None else source.estimate.frame
        return guard(table.STANDBY, lambda: self._carry_on(frame), lambda: last)

    def _estimated(self, frame: Frame, now: bool) -> tuple[bool, StateFrame | None]:
        """Run all work of the estimator for a frame, so that its exceptions belong to this frame."""
        self._source.receive(frame)
        self._source.advance()
        return True, self._source.state() if now else self._source.last

    def _carry_on(self, frame: SensorFrame) -> StateFrame | None:
        estimate, self._source.sensed = self._source.estimate, frame
        if estimate is None:
            return None
        self._missed += 1
        if self._inertial is None:
            self._inertial = InertialEstimate(estimate, self._gravity)
        known = self._inertial.step(frame)
        estimate = estimate._replace(frame=known, check=None)
        self.blind |= self._missed > _BRIDGED or self._defence.counts[table.ESTIMATOR] > _MAX_ERRORS
        if self.blind:
            (_, _, height_m), (_, _, climb_m_s) = estimate.position_std_m, estimate.velocity_std_m_s
            health = estimate.health._replace(
                horizontal_position=False,
                horizontal_velocity=False,
                dead_reckoning=True,
                gps_lost_since_us=known.time_us,
            )
            estimate = estimate._replace(
                position_std_m=(_UNKNOWN_M, _UNKNOWN_M, height_m),
                velocity_std_m_s=(_UNKNOWN_M, _UNKNOWN_M, climb_m_s),
                health=health,
            )
        self._source.estimate = estimate
        return known
