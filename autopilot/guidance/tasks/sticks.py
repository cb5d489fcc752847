"""The flight task of position mode."""

from math import hypot

from colibri.autopilot.guidance.reference import BindingDerivative, Target, still_target
from colibri.autopilot.guidance.tasks.task import EndlessTask, PositionMotion, TaskContext
from colibri.mavlink.setpoints.setpoints import Sticks, turned

_DEADZONE = 0.05
_SLOW_M_S, _SLOW_RAD_S = 0.1, 0.05
_MIDDLE = Sticks(0.0, 0.0, 0.5, 0.0)


class PositionTask(EndlessTask):
    """Sticks to velocity; a centred axis holds its position."""

    def __init__(self) -> None:
        self._xy: tuple[float, float] | None = None
        self._z: float | None = None
        self._yaw_rad: float | None = None

    def update(self, context: TaskContext) -> PositionMotion:
        sticks = context.steered.sticks or _MIDDLE
        target = still_target(context.place, context.yaw_rad, context.samples)
        horizontally = self._move(target, stick_velocity(sticks, context), context)
        vertically = self._climb(target, stick_climb(sticks, context), context)
        self._turn(target, stick_yaw_rate(sticks, context), context)
        kinds = (horizontally, horizontally, vertically)
        return PositionMotion(target._replace(kinds=kinds, turns=self._yaw_rad is not None), context.behaviour.limits)

    def _move(self, target: Target, velocity: tuple[float, float], context: TaskContext) -> BindingDerivative:
        if velocity != (0.0, 0.0):
            self._xy = None
        elif self._xy is None and hypot(*context.velocity[:2]) < _SLOW_M_S:
            self._xy = context.place[:2]
        target.motion[:, 1, :2] = velocity
        if self._xy is None:
            return BindingDerivative.VELOCITY
        target.motion[:, 0, :2] = self._xy
        return BindingDerivative.POSITION

    def _climb(self, target: Target, climb_m_s: float, context: TaskContext) -> BindingDerivative:
        if climb_m_s != 0.0:
            self._z = None
        elif self._z is None and abs(context.velocity[2]) < _SLOW_M_S:
            self._z = context.place[2]
        target.motion[:, 1, 2] = climb_m_s
        if self._z is None:
            return BindingDerivative.VELOCITY
        target.motion[:, 0, 2] = self._z
        return BindingDerivative.POSITION

    def _turn(self, target: Target, yaw_rate: float, context: TaskContext) -> None:
        if yaw_rate != 0.0:
            self._yaw_rad = None
        elif self._yaw_rad is None and abs(float(context.reference.heading[1])) < _SLOW_RAD_S:
            self._yaw_rad = context.yaw_rad
        target.heading[:, 1] = yaw_rate
        if self._yaw_rad is not None:
            target.heading[:, 0] = self._yaw_rad


def stick_velocity(sticks: Sticks, context: TaskContext) -> tuple[float, float]:
    """Return the velocity east and north, m/s; full sticks have equal speed in any direction."""
    ahead, left = dead(sticks.pitch), -dead(sticks.roll)
    behaviour = context.behaviour
    speed = min(behaviour.stick_speed_m_s, behaviour.max_speed_m_s) / max(1.0, hypot(ahead, left))
    east, north, _ = turned((speed * ahead, speed * left, 0.0), context.state.euler[2])
    return east, north


def stick_climb(sticks: Sticks, context: TaskContext) -> float:
    up = dead(2.0 * sticks.thrust - 1.0)
    behaviour = context.behaviour
    if up > 0.0:
        return up * (behaviour.stick_climb_m_s or behaviour.limits.climb_m_s)
    return up * (behaviour.stick_sink_m_s or behaviour.limits.sink_m_s)


def stick_yaw_rate(sticks: Sticks, context: TaskContext) -> float:
    return -dead(sticks.yaw) * context.behaviour.stick_yaw_rate_rad_s


def without_play(sticks: Sticks) -> Sticks:
    return sticks._replace(pitch=dead(sticks.pitch), roll=dead(sticks.roll), yaw=dead(sticks.yaw))


def dead(stick: float) -> float:
    """Remove the dead zone from a deflection, -1..1."""
    beyond = max(abs(stick) - _DEADZONE, 0.0) / (1.0 - _DEADZONE)
    return beyond if stick > 0.0 else -beyond
