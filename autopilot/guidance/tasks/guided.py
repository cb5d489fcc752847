"""The task of ArduPilot's GUIDED: one setpoint is enough; velocities, accelerations and attitudes lapse.

Sources: ArduCopter's mode_guided.cpp and autoyaw.cpp, and "Copter Commands in Guided Mode" of its wiki. A setpoint's
yaw stays until the next one; without yaw the vehicle looks along its way.
"""

from collections.abc import Callable
from math import hypot, isnan, nan, pi, tau
from typing import NamedTuple

from colibri.autopilot.guidance.attitude_reference import AttitudeReference
from colibri.autopilot.guidance.landing_detector import is_below
from colibri.autopilot.guidance.reference import Target
from colibri.autopilot.guidance.tasks.attitude import HeightLoop, TiltLoop, vertically
from colibri.autopilot.guidance.tasks.offboard import position_target
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Order
from colibri.autopilot.guidance.tasks.position import HoldTask
from colibri.autopilot.guidance.tasks.task import AttitudeMotion, EndlessTask, PositionMotion, TaskContext, lifts
from colibri.common.kernels import atan2
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, OffboardSetpoint, PositionSetpoint

STOP = PositionSetpoint(velocity_m_s=(0.0, 0.0, 0.0))
_HOVER, _LEAD_RAD = 0.5, 0.5 * pi
_ALONG_BEYOND_M, _ALONG_ABOVE_M_S = 2.0, 0.5  # shorter ways and lower speeds keep the heading


class GuidedSettings(NamedTuple):
    lapse_us: int  # time after which all but positions lapse (GUID_TIMEOUT)
    looks_ahead: bool  # whether the vehicle looks along its way (WP_YAW_BEHAVIOR)
    by_thrust: bool  # whether an attitude has a thrust, not a climb rate (GUID_OPTIONS)
    hover: float  # thrust of hover, 0..1 (MOT_THST_HOVER)


class Turn(NamedTuple):
    """A commanded heading, rad from east; `way` is 1 counter-clockwise, -1 clockwise, 0 the shorter one."""

    yaw_rad: float
    way: int = 0
    rate_rad_s: float = nan


class GuidedTask(EndlessTask):
    """Flies the latest setpoint; `paused` holds meanwhile."""

    def __init__(
        self, attitude: AttitudeReference | None, gravity_m_s2: float, settings: Callable[[], GuidedSettings]
    ) -> None:
        self._gravity_m_s2, self._settings = gravity_m_s2, settings
        self._tilt = TiltLoop(attitude) if attitude else None
        self._setpoint: OffboardSetpoint | None = None
        self._loop: HeightLoop | None = None
        self._hold = HoldTask()
        self._turn: Turn | None = None
        self.paused = self._looks_ahead = False

    @property
    def setpoint(self) -> PositionSetpoint | None:
        """The client's setpoint, without the heading along its way."""
        setpoint = self._setpoint
        if not isinstance(setpoint, PositionSetpoint):
            return None
        return setpoint._replace(yaw_rad=nan) if self._looks_ahead else setpoint

    @property
    def order(self) -> Order:
        """The order that a restart goes on with."""
        setpoint = self._setpoint
        if not isinstance(setpoint, PositionSetpoint) or any(map(isnan, setpoint.position_enu_m)):
            return Hold()
        return GoTo(setpoint.position_enu_m, None if isnan(setpoint.yaw_rad) else setpoint.yaw_rad)

    def take(self, setpoint: OffboardSetpoint, context: TaskContext) -> None:
        """Fly a setpoint; velocities along the heading stay as they are on earth."""
        self.paused = self._looks_ahead = False
        if isinstance(setpoint, PositionSetpoint):
            setpoint = setpoint.in_enu(context.state.euler[2])._replace(time_us=context.now_us)
            if not isnan(setpoint.yaw_rad) or not isnan(setpoint.yaw_rate_rad_s):
                self._turn = None
            elif self._settings().looks_ahead and (yaw_rad := _along(setpoint, context)) is not None:
                self._turn, setpoint, self._looks_ahead = None, setpoint._replace(yaw_rad=yaw_rad), True
            self._forget()
        elif not isinstance(self._setpoint, AttitudeSetpoint):
            self._forget()
        if self._setpoint is None:
            self._hold = HoldTask()
        self._setpoint = setpoint

    def turn(self, turn: Turn) -> None:
        self._turn = turn
        if isinstance(self._setpoint, PositionSetpoint):
            self._setpoint = self._setpoint._replace(yaw_rad=nan, yaw_rate_rad_s=nan)

    def _forget(self) -> None:
        self._loop = None
        if self._tilt:
            self._tilt.forget()

    def update(self, context: TaskContext) -> PositionMotion | AttitudeMotion:
        setpoint = None if self.paused else self._current(context.now_us)
        if isinstance(setpoint, AttitudeSetpoint) and self._tilt is not None:
            return self._by_attitude(self._tilt, setpoint, context)
        if isinstance(setpoint, PositionSetpoint):
            self._hold = HoldTask()
            motion = PositionMotion(position_target(setpoint, context), context.behaviour.limits)
        else:
            motion = self._hold.update(context)
        return motion if self._turn is None else self._turning(self._turn, motion, context)

    def _current(self, now_us: int) -> OffboardSetpoint | None:
        setpoint, settings = self._setpoint, self._settings()
        if setpoint is None or now_us - setpoint.time_us <= settings.lapse_us:
            return setpoint
        if isinstance(setpoint, PositionSetpoint) and not isnan(setpoint.position_enu_m[0]):
            (vx, vy, vz), late_s = setpoint.velocity_m_s, settings.lapse_us * 1e-6
            if not isnan(vx):  # stay where the moving target was by then
                x, y, z = setpoint.position_enu_m
                place = (x + vx * late_s, y + vy * late_s, z + (0.0 if isnan(vz) else vz * late_s))
                self._setpoint = PositionSetpoint(place, yaw_rad=setpoint.yaw_rad, time_us=setpoint.time_us)
            return self._setpoint
        self._setpoint = None
        self._forget()
        self._hold = HoldTask()
        return None

    def _turning(self, turn: Turn, motion: PositionMotion, context: TaskContext) -> PositionMotion:
        """Lead the heading a quarter turn ahead, until the way that was ordered is the shorter one."""
        yaw_rad = turn.yaw_rad
        if turn.way and (turn.way * (yaw_rad - context.yaw_rad)) % tau >= _LEAD_RAD:
            yaw_rad = context.yaw_rad + turn.way * _LEAD_RAD
        elif turn.way:
            self._turn = turn._replace(way=0)
        limits = motion.limits
        if not isnan(turn.rate_rad_s):
            limits = limits._replace(yaw_rate_rad_s=min(turn.rate_rad_s, limits.yaw_rate_rad_s))
        target: Target = motion.target
        heading = target.heading.copy()
        heading[:, 0], heading[:, 1:] = yaw_rad, 0.0
        return motion._replace(target=target._replace(heading=heading, turns=True), limits=limits)

    def _by_attitude(self, tilt: TiltLoop, setpoint: AttitudeSetpoint, context: TaskContext) -> AttitudeMotion:
        settings, generator = self._settings(), tilt.generator
        thrust = _HOVER if isnan(setpoint.thrust) else setpoint.thrust
        if settings.by_thrust:
            hover = settings.hover
            stick = _HOVER * thrust / hover if thrust < hover else 1.0 - _HOVER * (1.0 - thrust) / (1.0 - hover)
            return tilt.by_command(generator.from_setpoint(setpoint._replace(thrust=stick)), context)
        limits, up = context.behaviour.limits, (thrust - _HOVER) / _HOVER
        reference, target = vertically(context, up * (limits.climb_m_s if up > 0.0 else limits.sink_m_s), None)
        self._loop = self._loop or HeightLoop(generator.weight_n, self._gravity_m_s2)
        command = generator.from_setpoint(setpoint)._replace(thrust_n=self._loop.thrust_n(reference, context))
        sinks = is_below(reference.height_m, context.state)
        return tilt.by_command(command, context)._replace(
            reference=reference, lifts=lifts(target, context.state), sinks=sinks
        )


def _along(setpoint: PositionSetpoint, context: TaskContext) -> float | None:
    """Return the heading of a setpoint's way, rad; None if it is too slow or none is given."""
    (x, y, _), (vx, vy, _) = setpoint.position_enu_m, setpoint.velocity_m_s
    if not isnan(x):
        east, north = x - context.place[0], y - context.place[1]
        return atan2(north, east) if hypot(east, north) > _ALONG_BEYOND_M else context.yaw_rad
    return None if isnan(vx) or hypot(vx, vy) < _ALONG_ABOVE_M_S else atan2(vy, vx)
