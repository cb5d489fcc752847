"""The flight task of position mode."""

from math import hypot
from typing import TypeVar

from colibri.autopilot.guidance.reference import BindingDerivative, still_target
from colibri.autopilot.guidance.tasks.task import EndlessTask, PositionMotion, TaskContext
from colibri.mavlink.setpoints.setpoints import Sticks, turned

_DEADZONE = 0.05
_SLOW_M_S, _SLOW_RAD_S = 0.1, 0.05
_MIDDLE = Sticks(0.0, 0.0, 0.5, 0.0)

T = TypeVar("T")


class PositionTask(EndlessTask):
    """Sticks to velocity; a centred axis holds its position."""

    def __init__(self) -> None:
        self._xy: tuple[float, float] | None = None
        self._z: float | None = None
        self._yaw_rad: float | None = None

    def update(self, context: TaskContext) -> PositionMotion:
        sticks, place, velocity = context.steered.sticks or _MIDDLE, context.place, context.velocity
        moves, climbs = stick_velocity(sticks, context), stick_climb(sticks, context)
        turns = -dead(sticks.yaw) * context.behaviour.stick_yaw_rate_rad_s
        slowly_turning = abs(float(context.reference.heading[1])) < _SLOW_RAD_S
        self._xy = kept(self._xy, place[:2], moves == (0.0, 0.0), hypot(*velocity[:2]) < _SLOW_M_S)
        self._z = kept(self._z, place[2], climbs == 0.0, abs(velocity[2]) < _SLOW_M_S)
        self._yaw_rad = kept(self._yaw_rad, context.yaw_rad, turns == 0.0, slowly_turning)
        x, y = self._xy or place[:2]
        z, yaw_rad = place[2] if self._z is None else self._z, self._yaw_rad
        free, bound = BindingDerivative.VELOCITY, BindingDerivative.POSITION
        horizontally, vertically = free if self._xy is None else bound, free if self._z is None else bound
        heading_rad = context.yaw_rad if yaw_rad is None else yaw_rad
        target = still_target((x, y, z), heading_rad, context.samples, (horizontally, horizontally, vertically))
        target.motion[:, 1] = (*moves, climbs)
        target.heading[:, 1] = turns
        limits = context.behaviour.stick_limits or context.behaviour.limits
        return PositionMotion(target._replace(turns=yaw_rad is not None), limits)


def kept(before: T | None, now: T, centred: bool, slow: bool) -> T | None:
    """Return what a centred stick holds: the value at which the motion became slow."""
    if not centred:
        return None
    return now if before is None and slow else before


def stick_velocity(sticks: Sticks, context: TaskContext) -> tuple[float, float]:
    """Return the velocity east and north, m/s; full sticks have equal speed in any direction."""
    ahead, left = dead(sticks.pitch), -dead(sticks.roll)
    behaviour = context.behaviour
    speed = min(behaviour.stick_speed_m_s, behaviour.max_speed_m_s) / max(1.0, hypot(ahead, left))
    east, north, _ = turned((speed * ahead, speed * left, 0.0), context.state.euler[2])
    return east, north


def stick_climb(sticks: Sticks, context: TaskContext) -> float:
    up = dead(2.0 * sticks.thrust - 1.0)
    limits = context.behaviour.stick_limits or context.behaviour.limits
    return up * (limits.climb_m_s if up > 0.0 else limits.sink_m_s)


def without_play(sticks: Sticks) -> Sticks:
    return sticks._replace(pitch=dead(sticks.pitch), roll=dead(sticks.roll), yaw=dead(sticks.yaw))


def dead(stick: float) -> float:
    """Remove the dead zone from a deflection, -1..1."""
    beyond = max(abs(stick) - _DEADZONE, 0.0) / (1.0 - _DEADZONE)
    return beyond if stick > 0.0 else -beyond
