"""MAVLink commands to the vehicle, each checked and handed to the pilot: what is not finite or too large is denied."""

from collections.abc import Mapping
from math import hypot, isfinite, isnan, nan, pi, radians
from typing import Protocol

from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import Mode, Need, mode_of, mode_of_custom
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import Circle, GoTo
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask
from colibri.autopilot.guidance.tasks.task import FlightTask
from colibri.common.earth.geodesy import Geodetic, enu_of, is_on_earth
from colibri.common.kernels import cos, sin
from colibri.common.types import Vector
from colibri.mavlink.services.command import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Command,
    Handler,
    Outcome,
    outcome_of,
)
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.refusal import Refusal

FORCE_MAGIC = 21196
MAX_DISTANCE_M = 100_000.0
MAX_HEIGHT_M = 10_000.0
MIN_CLIMB_M = 0.2
"""Less would not lift the feet for sure."""
MIN_RADIUS_M = 1.0
MAX_YAW_RAD = 4.0 * pi
MAX_TURN_DEG = 360.0
_YAW_BEHAVIOURS = range(mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED + 1)
_POINTS = 72
"""Of a circle, that must all be inside the fence."""
_OVER_GROUND = (mav.SPEED_TYPE_AIRSPEED, mav.SPEED_TYPE_GROUNDSPEED)
"""SPEED_TYPE: without an airspeed sensor one is as good as the other."""
_SAME_SPEED, _DEFAULT_SPEED = -1.0, -2.0
_RELATIVE = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_CUSTOM = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


class Limit(Protocol):
    """What holds the vehicle back from places."""

    def refusal(self, place: Vector) -> Refusal | None:
        """Return why the vehicle may not fly to a place; None if it may."""
        ...


class Needs(Protocol):
    """What knows which needs of modes are met."""

    def missing(self) -> tuple[Need, ...]:
        """Return the needs that nothing meets now."""
        ...


class Commands:
    """Obeys what a ground station commands: a method a command."""

    def __init__(self, pilot: Pilot, fence: Limit, needs: Needs) -> None:
        """Hand commands to `pilot`, as far as `fence` and the needs of modes let it fly."""
        self._pilot = pilot
        self._fence = fence
        self._needs = needs
        self._home = pilot.home

    def handlers(self) -> Mapping[int, Handler]:
        """Return what obeys which command."""
        return {
            mav.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mav.MAV_CMD_DO_SET_MODE: self._set_mode,
            mav.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mav.MAV_CMD_NAV_LAND: lambda _: self._select(Mode.LAND),
            mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self._select(Mode.RETURN),
            mav.MAV_CMD_NAV_LOITER_UNLIM: lambda _: self._select(Mode.HOLD),
            mav.MAV_CMD_MISSION_START: lambda _: self._select(Mode.MISSION),
            mav.MAV_CMD_DO_PAUSE_CONTINUE: self._pause_or_go_on,
            mav.MAV_CMD_DO_REPOSITION: self._reposition,
            mav.MAV_CMD_DO_ORBIT: self._orbit,
            mav.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mav.MAV_CMD_DO_SET_HOME: self._set_home,
            mav.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mav.MAV_CMD_CONDITION_YAW: self._turn,
            mav.MAV_CMD_RUN_PREARM_CHECKS: self._check,
        }

    def guided_goto(self, latitude_deg: float, longitude_deg: float, altitude_m: float, frame: int) -> Refusal | None:
        """Fly to a place on earth, as DroneKit asks by a mission item outside a mission."""
        return self._go(latitude_deg, longitude_deg, altitude_m, frame, nan, nan)

    def select(self, mode: Mode | None) -> Refusal | None:
        """Change the mode, None being one that this vehicle does not have; return why not."""
        return Refusal("this vehicle has no such mode", UNSUPPORTED) if mode is None else self._choose(mode)

    def _choose(self, mode: Mode) -> Refusal | None:
        return self._pilot.select(mode, self._needs.missing())

    def _select(self, mode: Mode) -> Outcome:
        return outcome_of(self._choose(mode))

    def _fly(self, mode: Mode, task: FlightTask) -> Refusal | None:
        return self._pilot.fly(mode, task, self._needs.missing())

    def _arm_disarm(self, command: Command) -> Outcome:
        force = command.p2 == FORCE_MAGIC
        if command.p1 == 1.0:
            return outcome_of(self._pilot.arm(self._needs.missing(), force=force))
        if command.p1 == 0.0:
            return outcome_of(self._pilot.disarm(force=force))
        return Outcome(DENIED, "arm with 1, disarm with 0")

    def _set_mode(self, command: Command) -> Outcome:
        numbers = (command.p1, command.p2, 0.0 if isnan(command.p3) else command.p3)
        if not all(0.0 <= number < 256.0 and number == int(number) for number in numbers):
            return Outcome(DENIED, "mode refused: not a PX4 main and sub mode")
        base, main, sub = map(int, numbers)
        if not base & _CUSTOM:
            return Outcome(UNSUPPORTED, "mode refused: only custom modes are known")
        return outcome_of(self.select(mode_of(main, sub)))

    def set_custom_mode(self, base_mode: int, custom_mode: int) -> Refusal | None:
        """Obey a SET_MODE message; return why not."""
        return self.select(mode_of_custom(custom_mode) if base_mode & _CUSTOM else None)

    def _take_off(self, command: Command) -> Outcome:
        """Climb to z, or to the parameter's height: QGC sends it above sea level, others above home."""
        pilot = self._pilot
        height_m = pilot.ground.height_m + pilot.behaviour.takeoff_height_m
        if not isnan(command.z):
            height_m = self._height_of_takeoff(command)
        if not pilot.ground.height_m + MIN_CLIMB_M <= height_m < MAX_HEIGHT_M:
            return _denied("take-off", "not a height above the ground")
        context = pilot.context()
        x, y, _ = context.place
        refusal = self._fence.refusal((x, y, height_m))
        if refusal is not None:
            return _denied("take-off", refusal.reason)
        return outcome_of(
            self._fly(Mode.TAKEOFF, TakeoffTask(height_m, None, context, pilot.behaviour.takeoff_speed_m_s))
        )

    def _height_of_takeoff(self, command: Command) -> float:
        """Take z as above home, as most mean it, but from who says otherwise: QGC, which sends a pitch of -1."""
        above_sea = command.p1 == -1.0 if command.frame is None else command.frame not in _RELATIVE
        return command.z - self._home.origin.altitude_m if above_sea else self._home.position_enu_m[2] + command.z

    def _pause_or_go_on(self, command: Command) -> Outcome:
        if command.p1 == 0.0:
            return self._select(Mode.HOLD)
        return self._select(Mode.MISSION) if command.p1 == 1.0 else Outcome(DENIED, "pause with 0, go on with 1")

    def _reposition(self, command: Command) -> Outcome:
        """Fly to a place, or stop where none is given. Whoever asks means it, with or without the flag that says so."""
        if command.p2 not in (0.0, 1.0) and not isnan(command.p2):
            return _denied("reposition", f"a flag of {command.p2:g} is not known")
        if not (isnan(command.p4) or abs(command.p4) <= MAX_YAW_RAD):
            return _denied("reposition", "yaw is in radians")
        speed = nan if command.p1 in (-1.0, 0.0) else command.p1
        if not (isnan(speed) or self._may_fly_at(speed)):
            return _denied("reposition", f"a speed of {speed:g} m/s")
        if all(map(isnan, (command.x, command.y, command.z, command.p4))):
            return outcome_of(self._fly(Mode.HOLD, HoldTask()))
        frame = mav.MAV_FRAME_GLOBAL if command.frame is None else command.frame
        return outcome_of(self._go(command.x, command.y, command.z, frame, command.p4, speed))

    def _go(self, x: float, y: float, z: float, frame: int, yaw_ned: float, speed: float) -> Refusal | None:
        pilot = self._pilot
        if not self._flies:
            return Refusal("reposition refused: the vehicle is not flying")
        context = pilot.context()
        place, only_height = context.place, isnan(x) and isnan(y)
        if not only_height:
            if not is_on_earth(x, y):
                return Refusal("reposition refused: not a latitude and longitude")
            place = (*enu_of(Geodetic(x, y, 0.0), self._home.origin)[:2], place[2])
        if not isnan(z):
            height_m = self._home.position_enu_m[2] + z if frame in _RELATIVE else z - self._home.origin.altitude_m
            place = (place[0], place[1], height_m)
        refusal = self.unreachable(place)
        if refusal is not None:
            return Refusal(f"reposition refused: {refusal.reason}")
        yaw = 0.5 * pi - yaw_ned if not isnan(yaw_ned) else context.yaw_rad if only_height else None
        return self._fly(Mode.HOLD, GoToTask(GoTo(place, yaw, None if isnan(speed) else speed), context))

    @property
    def _flies(self) -> bool:
        return self._pilot.state.armed and not self._pilot.ground.standing

    def _may_fly_at(self, speed_m_s: float) -> bool:
        return 0.0 < speed_m_s <= self._pilot.behaviour.max_speed_m_s

    def unreachable(self, place: Vector) -> Refusal | None:
        """Return why the vehicle may not fly to a place; None if it may."""
        away = hypot(place[0], place[1])
        if not isfinite(away) or away > MAX_DISTANCE_M or not -MAX_HEIGHT_M < place[2] < MAX_HEIGHT_M:
            return Refusal("too far away")
        return self._fence.refusal(place)

    def _orbit(self, command: Command) -> Outcome:
        """Fly around; z is above sea level whatever the frame says, as MAVSDK and PX4 take it."""
        pilot = self._pilot
        if not self._flies:
            return _denied("orbit", "the vehicle is not flying")
        context = pilot.context()
        x, y, z = context.place
        if not (isnan(command.x) and isnan(command.y)):
            if not is_on_earth(command.x, command.y):
                return _denied("orbit", "not a latitude and longitude")
            x, y, _ = enu_of(Geodetic(command.x, command.y, 0.0), self._home.origin)
        if not isnan(command.z):
            z = command.z - self._home.origin.altitude_m
        radius = pilot.behaviour.orbit_radius_m if isnan(command.p1) else command.p1
        speed = None if isnan(command.p2) else abs(command.p2)
        yaw = 0.0 if isnan(command.p3) else command.p3
        circle = Circle((x, y, z), radius, speed, int(yaw) if yaw in _YAW_BEHAVIOURS else -1)
        refusal = self._no_circle(circle)
        if refusal is not None:
            return _denied("orbit", refusal.reason)
        return outcome_of(self._fly(Mode.ORBIT, OrbitTask(circle, context)))

    def _no_circle(self, circle: Circle) -> Refusal | None:
        """Return why the vehicle may not fly a circle; None if it may."""
        (x, y, z), radius, speed, yaw_behaviour = circle
        if not MIN_RADIUS_M <= abs(radius) <= MAX_DISTANCE_M:
            return Refusal(f"a radius of {radius:g} m")
        if speed is not None and not self._may_fly_at(speed):
            return Refusal(f"a speed of {speed:g} m/s")
        if yaw_behaviour not in _YAW_BEHAVIOURS:
            return Refusal("no such yaw behaviour")
        angles = (2.0 * pi * point / _POINTS for point in range(_POINTS))
        around = ((x + radius * cos(angle), y + radius * sin(angle), z) for angle in angles)
        return next(filter(None, map(self.unreachable, around)), None)

    def _change_speed(self, command: Command) -> Outcome:
        """Set the speed over ground; -1 leaves it, -2 is the parameters'."""
        kind, speed, _, relative = command[1:5]
        if kind not in _OVER_GROUND and not isnan(kind):
            return Outcome(UNSUPPORTED, "speed refused: only that over ground can be set")
        if relative == 1.0:
            return Outcome(UNSUPPORTED, "speed refused: only absolute ones can be set")
        if speed == _DEFAULT_SPEED:
            self._pilot.fly_at(None)
        elif self._may_fly_at(speed):
            self._pilot.fly_at(speed)
        elif speed != _SAME_SPEED:
            return _denied("speed", f"{speed:g} m/s")
        return Outcome()

    def _set_home(self, command: Command) -> Outcome:
        if command.p1 == 1.0:
            state = self._pilot.context().state
            self._home.move(state.position_enu_m, state.euler[2])
            return Outcome()
        if command.p1 != 0.0 and not isnan(command.p1):
            return _denied("home", "1 is here, 0 is there")
        if not is_on_earth(command.x, command.y) or not isfinite(command.z):
            return _denied("home", "not a latitude, longitude and altitude")
        return outcome_of(self.move_home(Geodetic(command.x, command.y, command.z)))

    def move_home(self, place: Geodetic) -> Refusal | None:
        """Have home at a place on earth; return why not."""
        home = enu_of(place, self._home.origin)
        refusal = self.unreachable(home)
        if refusal is not None:
            return Refusal(f"home refused: {refusal.reason}")
        self._home.move(home, self._home.yaw_rad)
        return None

    def _terminate(self, command: Command) -> Outcome:
        if command.p1 == 1.0:
            return outcome_of(self._pilot.disarm(force=True))
        return Outcome(DENIED, "flight terminated by 1 alone, and never undone")

    def _turn(self, command: Command) -> Outcome:
        """Turn on the spot; the angle counts clockwise from north, or from the heading now where p4 is 1."""
        angle, _, way, relative = (0.0 if isnan(value) else value for value in command[1:5])
        if isnan(command.p1) or abs(angle) > MAX_TURN_DEG or way not in (-1.0, 0.0, 1.0):
            return _denied("turn", "not an angle and a direction")
        if relative not in (0.0, 1.0):
            return _denied("turn", "1 counts from the heading, 0 from north")
        if not self._flies:
            return Outcome(TEMPORARILY_REJECTED, "turn refused: the vehicle is not flying")
        context = self._pilot.context()
        zero_rad = context.yaw_rad if relative else 0.5 * pi
        yaw = zero_rad - radians(-angle if relative and way < 0.0 else angle)
        return outcome_of(self._fly(Mode.HOLD, GoToTask(GoTo(context.place, yaw), context)))

    def _check(self, command: Command) -> Outcome:
        del command
        reasons = self._pilot.readiness.refusals()
        return Outcome(FAILED, "not ready: " + "; ".join(reasons)) if reasons else Outcome(ACCEPTED)


def _denied(what: str, reason: str) -> Outcome:
    return Outcome(DENIED, f"{what} refused: {reason}")
