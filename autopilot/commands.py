"""MAVLink commands to the vehicle, each checked and handed to the pilot: what is not finite or too large is denied."""

from collections.abc import Callable, Mapping
from math import hypot, isfinite, isnan, nan, pi

from autopilot.courses import Climb, Round, Stop, Way
from autopilot.modes import Mode, Refusal, mode_of, mode_of_custom
from autopilot.orders import Circle, GoTo
from autopilot.pilot import Pilot
from mavlink.dialect import mav
from mavlink.frames import Vector
from mavlink.geodesy import Geodetic, enu_of, is_on_earth
from mavlink.services.command import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Command,
    Handler,
    Outcome,
)

FORCE_MAGIC = 21196
FARTHEST_M = 100_000.0
HIGHEST_M = 10_000.0
SMALLEST_RADIUS_M = 1.0
_RELATIVE = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_CUSTOM = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED

Fence = Callable[[Vector], str]
"""(position) -> why the vehicle may not fly there; empty if it may."""


class Commands:
    """Obeys what a ground station commands.

    Attributes:
        origin: Of the ENU frame, on earth.
    """

    def __init__(self, pilot: Pilot, origin: Geodetic, fence: Fence) -> None:
        """Hand commands to `pilot`."""
        self._pilot = pilot
        self._fence = fence
        self.origin = origin

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

    def guided_goto(self, latitude_deg: float, longitude_deg: float, altitude_m: float, frame: int) -> Outcome:
        """Fly to a place on earth, as DroneKit asks by a mission item outside a mission."""
        return self._go(latitude_deg, longitude_deg, altitude_m, frame, nan, nan)

    def select(self, mode: Mode | None) -> Outcome:
        """Change the mode; None is a mode that this vehicle does not have."""
        if mode is None:
            return Outcome(UNSUPPORTED, "this vehicle has no such mode")
        return self._select(mode)

    def _select(self, mode: Mode) -> Outcome:
        return _outcome(self._pilot.select(mode))

    def _arm_disarm(self, command: Command) -> Outcome:
        force = command.p2 == FORCE_MAGIC
        if command.p1 == 1.0:
            return _outcome(self._pilot.arm(force=force))
        if command.p1 == 0.0:
            return _outcome(self._pilot.disarm(force=force))
        return Outcome(DENIED, "arm with 1, disarm with 0")

    def _set_mode(self, command: Command) -> Outcome:
        numbers = (command.p1, command.p2, 0.0 if isnan(command.p3) else command.p3)
        if not all(0.0 <= number < 256.0 and number == int(number) for number in numbers):
            return Outcome(DENIED, "mode refused: not a PX4 main and sub mode")
        base, main, sub = map(int, numbers)
        if not base & _CUSTOM:
            return Outcome(UNSUPPORTED, "mode refused: only custom modes are known")
        return self.select(mode_of(main, sub))

    def set_custom_mode(self, base_mode: int, custom_mode: int) -> Outcome:
        """Obey a SET_MODE message."""
        return self.select(mode_of_custom(custom_mode) if base_mode & _CUSTOM else None)

    def _take_off(self, command: Command) -> Outcome:
        """Climb to z, or to the parameter's height: QGC sends it above sea level, others above home."""
        pilot = self._pilot
        base_m = pilot.home_enu_m[2]
        height_m = base_m + pilot.behaviour.takeoff_height_m
        if not isnan(command.z):
            height_m = self._height_of_takeoff(command)
        if not isfinite(height_m) or not base_m < height_m < HIGHEST_M:
            return Outcome(DENIED, "take-off refused: not a height above home")
        scene = pilot.scene()
        x, y, _ = scene.place
        refused = self._fence((x, y, height_m))
        if refused:
            return Outcome(DENIED, f"take-off refused: {refused}")
        return _outcome(pilot.fly(Mode.TAKEOFF, Climb(height_m, None, scene)))

    def _height_of_takeoff(self, command: Command) -> float:
        """Take z as above home, as most mean it, but from who says otherwise: QGC, which sends a pitch of -1."""
        above_sea = command.p1 == -1.0 if command.frame is None else command.frame not in _RELATIVE
        return command.z - self.origin.altitude_m if above_sea else self._pilot.home_enu_m[2] + command.z

    def _pause_or_go_on(self, command: Command) -> Outcome:
        if command.p1 == 0.0:
            return self._select(Mode.HOLD)
        return self._select(Mode.MISSION) if command.p1 == 1.0 else Outcome(DENIED, "pause with 0, go on with 1")

    def _reposition(self, command: Command) -> Outcome:
        speed = command.p1 if command.p1 > 0.0 else nan
        if not (isnan(command.p4) or abs(command.p4) <= 4.0 * pi):
            return Outcome(DENIED, "reposition refused: yaw is in radians")
        if isnan(command.x) and isnan(command.y) and isnan(command.z) and isnan(command.p4):
            return _outcome(self._pilot.fly(Mode.HOLD, Stop()))
        frame = mav.MAV_FRAME_GLOBAL if command.frame is None else command.frame
        return self._go(command.x, command.y, command.z, frame, command.p4, speed)

    def _go(self, x: float, y: float, z: float, frame: int, yaw_ned: float, speed: float) -> Outcome:
        pilot = self._pilot
        if pilot.standing or not pilot.state.armed:
            return Outcome(DENIED, "reposition refused: the vehicle is not flying")
        scene = pilot.scene()
        if isnan(x) and isnan(y):
            place = scene.place
        elif is_on_earth(x, y):
            place = (*enu_of(Geodetic(x, y, 0.0), self.origin)[:2], scene.place[2])
        else:
            return Outcome(DENIED, "reposition refused: not a latitude and longitude")
        if not isnan(z):
            height_m = pilot.home_enu_m[2] + z if frame in _RELATIVE else z - self.origin.altitude_m
            place = (place[0], place[1], height_m)
        refused = self.unreachable(place)
        if refused:
            return Outcome(DENIED, f"reposition refused: {refused}")
        only_height = isnan(x) and isnan(y)
        yaw = 0.5 * pi - yaw_ned if not isnan(yaw_ned) else scene.yaw_rad if only_height else None
        way = Way(GoTo(place, yaw, speed if speed > 0.0 else None), scene)
        return _outcome(pilot.fly(Mode.HOLD, way))

    def unreachable(self, place: Vector) -> str:
        """Return why the vehicle may not fly to a place; empty if it may."""
        away = hypot(place[0], place[1])
        if not isfinite(away) or away > FARTHEST_M or not -HIGHEST_M < place[2] < HIGHEST_M:
            return "too far away"
        return self._fence(place)

    def _orbit(self, command: Command) -> Outcome:
        """Fly around; z is above sea level whatever the frame says, as MAVSDK and PX4 take it."""
        pilot = self._pilot
        scene = pilot.scene()
        if pilot.standing:
            return Outcome(DENIED, "orbit refused: the vehicle is not flying")
        x, y, z = scene.place
        if not (isnan(command.x) or isnan(command.y)):
            if not is_on_earth(command.x, command.y):
                return Outcome(DENIED, "orbit refused: not a latitude and longitude")
            x, y, _ = enu_of(Geodetic(command.x, command.y, 0.0), self.origin)
        if not isnan(command.z):
            z = command.z - self.origin.altitude_m
        radius = pilot.behaviour.orbit_radius_m if isnan(command.p1) else command.p1
        speed = None if isnan(command.p2) else abs(command.p2)
        yaw = 0.0 if isnan(command.p3) else command.p3
        if not SMALLEST_RADIUS_M <= abs(radius) <= FARTHEST_M:
            return Outcome(DENIED, f"orbit refused: a radius of {radius:g} m")
        if speed is not None and not 0.0 < speed <= pilot.behaviour.fastest_m_s:
            return Outcome(DENIED, f"orbit refused: a speed of {speed:g} m/s")
        if not 0.0 <= yaw <= mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED:
            return Outcome(DENIED, "orbit refused: no such yaw behaviour")
        refused = self.unreachable((x, y, z))
        if refused:
            return Outcome(DENIED, f"orbit refused: {refused}")
        return _outcome(pilot.fly(Mode.ORBIT, Round(Circle((x, y, z), radius, speed, int(yaw)), scene)))

    def _change_speed(self, command: Command) -> Outcome:
        if command.p2 == -1.0:
            return Outcome()
        if command.p2 == -2.0:
            self._pilot.speed_m_s = None
        elif 0.0 < command.p2 <= self._pilot.behaviour.fastest_m_s:
            self._pilot.speed_m_s = command.p2
        else:
            return Outcome(DENIED, f"a speed of {command.p2:g} m/s refused")
        return Outcome()

    def _set_home(self, command: Command) -> Outcome:
        pilot = self._pilot
        if command.p1 == 1.0:
            scene = pilot.scene()
            pilot.set_home(scene.state.position_enu_m, scene.state.euler[2])
            return Outcome()
        if not is_on_earth(command.x, command.y) or not isfinite(command.z):
            return Outcome(DENIED, "home refused: not a latitude, longitude and altitude")
        home = enu_of(Geodetic(command.x, command.y, command.z), self.origin)
        if hypot(home[0], home[1]) > FARTHEST_M or abs(home[2]) > HIGHEST_M:
            return Outcome(DENIED, "home refused: too far away")
        pilot.set_home(home, pilot.home_yaw_rad)
        return Outcome()

    def _terminate(self, command: Command) -> Outcome:
        if command.p1 >= 0.5:
            return _outcome(self._pilot.disarm(force=True))
        return Outcome(DENIED, "nothing to undo: the flight is not terminated")

    def _turn(self, command: Command) -> Outcome:
        if not isfinite(command.p1):
            return Outcome(DENIED, "turn refused: no angle")
        pilot = self._pilot
        if pilot.standing:
            return Outcome(TEMPORARILY_REJECTED, "turn refused: the vehicle is not flying")
        scene = pilot.scene()
        yaw = 0.5 * pi - command.p1 * pi / 180.0
        if command.p4 == 1.0:
            yaw = scene.yaw_rad - command.p1 * pi / 180.0 * (-1.0 if command.p3 < 0.0 else 1.0)
        return _outcome(pilot.fly(Mode.HOLD, Way(GoTo(scene.place, yaw), scene)))

    def _check(self, command: Command) -> Outcome:
        del command
        reasons = self._pilot.refusals()
        return Outcome(FAILED, "not ready: " + "; ".join(reasons)) if reasons else Outcome(ACCEPTED)


def _outcome(refusal: Refusal | None) -> Outcome:
    return Outcome() if refusal is None else Outcome(DENIED, refusal.reason)
