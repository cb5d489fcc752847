"""Sticks to velocity, for a pilot who flies by place."""

from autopilot.courses import Motion, Scene
from autopilot.reference import Kind, Target, still_target
from mavlink.frames import Vector
from mavlink.setpoints import Sticks, turned

_DEADZONE = 0.05
_SLOW_M_S, _SLOW_RAD_S = 0.1, 0.05


class PositionSticks:
    """Sticks to velocity; what is not asked to move is held where it came to rest."""

    def __init__(self) -> None:
        """Hold nothing yet."""
        self._place: list[float | None] = [None, None, None]
        self._yaw_rad: float | None = None

    def ask(self, scene: Scene) -> Motion:
        """Return velocities along the heading, or places."""
        sticks = scene.steered.sticks
        velocity, yaw_rate = (0.0, 0.0, 0.0), 0.0
        if sticks is not None:
            velocity, yaw_rate = stick_velocity(sticks, scene), stick_yaw_rate(sticks, scene)
        at_rest = [abs(float(speed)) < _SLOW_M_S for speed in scene.reference.motion[1]]
        still = (velocity[0] == velocity[1] == 0.0 and at_rest[0] and at_rest[1],) * 2
        still = (*still, velocity[2] == 0.0 and at_rest[2])  # type: ignore[assignment]
        target = still_target(scene.place, scene.yaw_rad, scene.samples)
        kinds = []
        for axis, rests in enumerate(still):
            moves = velocity[axis] != 0.0 or (axis < 2 and (velocity[0] != 0.0 or velocity[1] != 0.0))
            place = None if moves else self._place[axis]
            place = scene.place[axis] if rests and place is None else place
            self._place[axis] = place
            kinds.append(Kind.VELOCITY if place is None else Kind.POSITION)
            target.motion[:, 0, axis] = scene.place[axis] if place is None else place
            target.motion[:, 1, axis] = velocity[axis]
        self._hold_yaw(target, yaw_rate, scene)
        limits = scene.behaviour.limits
        x, y, z = kinds
        return Motion(target._replace(kinds=(x, y, z), turns=self._yaw_rad is not None), limits)

    def _hold_yaw(self, target: Target, yaw_rate: float, scene: Scene) -> None:
        turning = abs(float(scene.reference.heading[1])) > _SLOW_RAD_S
        if yaw_rate != 0.0:
            self._yaw_rad = None
        elif self._yaw_rad is None and not turning:
            self._yaw_rad = scene.yaw_rad
        target.heading[:, 1] = yaw_rate
        if self._yaw_rad is not None:
            target.heading[:, 0] = self._yaw_rad

    def arrived(self, scene: Scene) -> bool:
        """Never by itself."""
        del scene
        return False


def stick_velocity(sticks: Sticks, scene: Scene) -> Vector:
    """Return the velocity, m/s, ENU, that sticks ask for."""
    limits, behaviour = scene.behaviour.limits, scene.behaviour
    x, y, _ = turned((dead(sticks.pitch), -dead(sticks.roll), 0.0), scene.state.euler[2])
    up = dead(2.0 * sticks.thrust - 1.0)
    climb = up * (limits.climb_m_s if up > 0.0 else limits.sink_m_s)
    return (behaviour.stick_speed_m_s * x, behaviour.stick_speed_m_s * y, climb)


def stick_yaw_rate(sticks: Sticks, scene: Scene) -> float:
    """Return the yaw rate, rad/s, that sticks ask for."""
    return -dead(sticks.yaw) * scene.behaviour.stick_yaw_rate_rad_s


def dead(stick: float) -> float:
    """Return a stick's deflection, -1..1, without the play around its middle."""
    beyond = max(abs(stick) - _DEADZONE, 0.0) / (1.0 - _DEADZONE)
    return beyond if stick > 0.0 else -beyond
