"""The task of offboard mode."""

from math import hypot, isnan

import numpy as np

from colibri.autopilot.guidance.attitude_reference import AttitudeReference
from colibri.autopilot.guidance.reference import BindingDerivative, Target, still_target
from colibri.autopilot.guidance.tasks.attitude import TiltLoop
from colibri.autopilot.guidance.tasks.position import HoldTask
from colibri.autopilot.guidance.tasks.task import AttitudeMotion, EndlessTask, PositionMotion, TaskContext
from colibri.common.types import Vector
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, PositionSetpoint

UP = 2
MAX_RATES_AGE_US = 300_000
_BRAKE_1_S = 2.0  # rate at which an acceleration fades near the speed limit


class OffboardTask(EndlessTask):
    def __init__(self, attitude: AttitudeReference | None) -> None:
        self._tilt = TiltLoop(attitude) if attitude else None
        self._hold = HoldTask()

    def update(self, context: TaskContext) -> PositionMotion | AttitudeMotion:
        setpoint = context.steered.setpoint
        if isinstance(setpoint, PositionSetpoint):
            if self._tilt:
                self._tilt.forget()
            self._hold = HoldTask()
            target = position_target(setpoint.in_enu(context.state.euler[2]), context)
            return PositionMotion(target, context.behaviour.limits)
        if isinstance(setpoint, AttitudeSetpoint) and self._tilt and not rates_stale(setpoint, context.now_us):
            self._hold = HoldTask()
            return self._tilt.by_command(self._tilt.generator.from_setpoint(setpoint), context)
        if self._tilt:
            self._tilt.forget()
        return self._hold.update(context)


def rates_stale(setpoint: AttitudeSetpoint, now_us: int) -> bool:
    """Check the age of body rates: those of a silent companion would turn the vehicle over. An attitude may stay."""
    return setpoint.attitude is None and now_us - setpoint.time_us > MAX_RATES_AGE_US


def position_target(setpoint: PositionSetpoint, context: TaskContext) -> Target:
    """Return a setpoint's target: each axis is bound by its lowest given derivative."""
    target = still_target(context.place, context.yaw_rad, context.samples)
    velocity = allowed_velocity(setpoint.velocity_m_s, context)
    ahead_s = (context.now_us - setpoint.time_us) * 1e-6 + context.interval_s * np.arange(context.samples)
    kinds = []
    for axis in range(3):
        p, v, a = setpoint.position_enu_m[axis], velocity[axis], setpoint.acceleration_m_s2[axis]
        v_or_0 = 0.0 if isnan(v) else v
        if not isnan(p):
            kinds.append(BindingDerivative.POSITION)
            target.motion[:, 0, axis] = p + v_or_0 * ahead_s
        elif not isnan(v) or isnan(a):
            kinds.append(BindingDerivative.VELOCITY)
        else:
            kinds.append(BindingDerivative.ACCELERATION)
        target.motion[:, 1, axis] = v_or_0
        if not isnan(a):
            target.motion[:, 2, axis] = allowed_acceleration(a, axis, context)
    x, y, z = kinds
    target.heading[:, 1] = 0.0 if isnan(setpoint.yaw_rate_rad_s) else setpoint.yaw_rate_rad_s
    if not isnan(setpoint.yaw_rad):
        target.heading[:, 0] = setpoint.yaw_rad
    return target._replace(kinds=(x, y, z), turns=not isnan(setpoint.yaw_rad))


def allowed_velocity(velocity: Vector, context: TaskContext) -> Vector:
    """Limit a velocity; nan stays nan."""
    x, y, z = velocity
    fast = hypot(*(0.0 if isnan(v) else v for v in (x, y)))
    share = min(1.0, context.behaviour.max_speed_m_s / fast) if fast > 0.0 else 1.0
    limits = context.behaviour.limits
    return (share * x, share * y, z if isnan(z) else min(max(z, -limits.sink_m_s), limits.climb_m_s))


def allowed_acceleration(acceleration: float, axis: int, context: TaskContext) -> float:
    limits, speed = context.behaviour.limits, context.velocity[axis]
    up, down, maximum = context.behaviour.max_speed_m_s, context.behaviour.max_speed_m_s, limits.acceleration_m_s2
    if axis == UP:
        up, down, maximum = limits.climb_m_s, limits.sink_m_s, limits.lift_m_s2
    minimum = max(-maximum, _BRAKE_1_S * (-down - speed))
    return min(max(acceleration, minimum), min(maximum, _BRAKE_1_S * (up - speed)))
