"""ArduCopter's commands to move, most of them in mode GUIDED.

Source: ArduCopter's GCS_MAVLink_Copter.cpp and mode_guided.cpp, 4.6.
"""

from collections.abc import Callable
from math import isfinite, isnan, nan, pi, radians

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.mode_selection import ModeSelection
from colibri.autopilot.commander.motion_commands import MAX_TURN_DEG, MIN_CLIMB_M, MotionCommands
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import MANUAL, Mode
from colibri.autopilot.guidance.tasks.guided import STOP, GuidedTask, Turn
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import Orbit, turn_of
from colibri.autopilot.guidance.tasks.position import TakeoffTask
from colibri.common.kernels import cos, sin
from colibri.common.types import Vector
from colibri.mavlink.services.command import DENIED, FAILED, ReceivedCommand
from colibri.mavlink.setpoints.setpoints import OffboardSetpoint, PositionSetpoint
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.mavlink.wire.places import MAX_HEIGHT_M

GUIDED, GUIDED_NOGPS, LOITER, ALT_HOLD, POSHOLD, CIRCLE, AUTO = 4, 20, 5, 2, 16, 7, 3  # numbers of modes
_ABOVE_HOME = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_CHANGES_MODE = 1.0
_ARRIVES_WITHIN_M = 0.3  # distance at which a take-off ends, added where sticks take over
_LIFTING_US = 500_000  # time in which a take-off by stick may become one to a height


class CopterMotion(MotionCommands):
    def __init__(
        self,
        pilot: Pilot,
        fence: Fence,
        needs: ModeNeeds,
        modes: ModeSelection,
        new_task: Callable[[], GuidedTask],
        circle: Callable[[], tuple[float, float]],
    ) -> None:
        """`circle` returns radius, m, and speed, m/s, of mode CIRCLE."""
        super().__init__(pilot, fence, needs)
        self._modes, self._new_task, self._circle = modes, new_task, circle

    @property
    def guided(self) -> bool:
        return self._modes.shown.number in (GUIDED, GUIDED_NOGPS)

    def setpoint(self, setpoint: OffboardSetpoint | None) -> None:
        """Fly a setpoint in GUIDED; stop at an invalid one (None)."""
        if self.guided and self._pilot.state.armed:
            self._take(setpoint or STOP)

    def _take(self, setpoint: OffboardSetpoint) -> Refusal | None:
        task = self.task
        refusal = None if task is not None else self._fly(Mode.HOLD, task := self._new_task())
        if refusal is None and task is not None:
            task.take(setpoint, self._pilot.context())
        return refusal

    @property
    def task(self) -> GuidedTask | None:
        """The task of GUIDED, if it is flown."""
        task = self._pilot.task
        return task if isinstance(task, GuidedTask) else None

    def _take_off(self, command: ReceivedCommand) -> Refusal | None:
        pilot, number = self._pilot, self._modes.shown.number
        if command.frame is not None and command.frame not in _ABOVE_HOME:
            return Refusal(f"Takeoff: frame {command.frame} is not relative to home", DENIED)
        by_sticks = number in (LOITER, POSHOLD, ALT_HOLD)
        if not pilot.state.armed or not pilot.ground.standing or not (self.guided or by_sticks):
            return Refusal("Takeoff: arm on the ground in GUIDED first", FAILED)
        if by_sticks and command.p3 != 1.0 and number != LOITER:
            return Refusal("Takeoff: parameter 3 must be 1 in this mode", FAILED)
        up_m = self._home.position_enu_m[2] + (0.0 if isnan(command.z) else command.z)
        if not pilot.ground.height_m + MIN_CLIMB_M <= up_m < MAX_HEIGHT_M:
            return Refusal(f"Takeoff: {command.z:g} m above home is not above the vehicle", FAILED)
        context = pilot.context()
        refusal = self._fly(Mode.TAKEOFF, TakeoffTask(up_m, None, context, context.behaviour.limits.climb_m_s))
        return refusal and refusal._replace(result=FAILED)

    def takeoff_by_stick(self, height_m: float) -> None:
        """Climb to a height above the ground, in modes that hold height."""
        pilot = self._pilot
        lifts = pilot.sensed.now_us - pilot.ground.times.takeoff_us < _LIFTING_US and pilot.state.mode in MANUAL
        if (pilot.ground.standing or lifts) and self._modes.shown.number in (LOITER, POSHOLD, ALT_HOLD):
            context = pilot.context()
            up_m = pilot.ground.height_m + height_m + _ARRIVES_WITHIN_M
            limits = context.behaviour.stick_limits
            self._fly(Mode.TAKEOFF, TakeoffTask(up_m, None, context, limits and limits.climb_m_s))

    def guided_goto(self, latitude_deg: float, longitude_deg: float, altitude_m: float, frame: int) -> Refusal | None:
        if not self.guided:
            return Refusal("the vehicle is not in GUIDED", FAILED)
        return super().guided_goto(latitude_deg, longitude_deg, altitude_m, frame)

    def _reposition(self, command: ReceivedCommand) -> Refusal | None:
        if not self.guided:
            if isnan(command.p2) or not int(command.p2) & int(_CHANGES_MODE):
                return Refusal("reposition: not in GUIDED, and flag 1 is not set", DENIED)
            refusal = self._modes.select(GUIDED)
            if refusal is not None:
                return refusal
        if not isnan(command.p1) and command.p1 > 0.0:
            self._pilot.speed_m_s = min(command.p1, self._pilot.behaviour.max_speed_m_s)
        return self._go(command, None)

    def _go(self, command: ReceivedCommand, speed_m_s: float | None) -> Refusal | None:
        del speed_m_s  # GUIDED has one speed
        place = self.read(command)
        refusal = place if isinstance(place, Refusal) else self.unreachable(place)
        if isinstance(refusal, Refusal):
            return Refusal(f"reposition: {refusal.reason}", DENIED)
        if not self._pilot.state.armed:
            return None  # accepted and forgotten, as in ArduCopter
        return self._take(PositionSetpoint(place))  # type: ignore[arg-type]

    def _turn(self, command: ReceivedCommand) -> Refusal | None:
        angle, rate, way, relative = (0.0 if isnan(value) else value for value in command[1:5])
        if isnan(command.p1) or not 0.0 <= angle <= MAX_TURN_DEG or way not in (-1.0, 0.0, 1.0):
            return Refusal(f"turn: angle {command.p1:g} or direction {way:g} is not valid", FAILED)
        if relative not in (0.0, 1.0):
            return Refusal(f"turn: {relative:g} is not 1, from the heading, or 0, from north", FAILED)
        if not self._flies or not self.guided:
            return None  # without effect elsewhere, as in ArduCopter
        context = self._pilot.context()
        zero_rad = context.yaw_rad if relative else 0.5 * pi
        yaw_rad = zero_rad - radians(-angle if relative and way < 0.0 else angle)
        task = self.task
        if task is None:
            refusal = self._fly(Mode.HOLD, task := self._new_task())
            if refusal is not None:
                return refusal
        task.turn(Turn(yaw_rad, turn_of(angle, way), radians(rate) if rate > 0.0 and isfinite(rate) else nan))
        return None

    def circle(self) -> Refusal | None:
        """Fly around the point ahead, facing it; a rate of 0 only faces it."""
        context, (radius_m, speed_m_s) = self._pilot.context(), self._circle()
        (x, y, z), yaw_rad = context.place, context.yaw_rad
        center: Vector = (x + radius_m * cos(yaw_rad), y + radius_m * sin(yaw_rad), z)
        facing = int(mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER)
        order = Orbit(center, radius_m if speed_m_s >= 0.0 else -radius_m, abs(speed_m_s) or None, facing)
        return self._fly(Mode.ORBIT, OrbitTask(order, context))
