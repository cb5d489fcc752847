"""MAVLink commands to move: take-off, reposition, orbit, turn."""

from collections.abc import Mapping
from math import hypot, isfinite, isnan, nan, pi, radians
from typing import Protocol

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import GoTo, Orbit
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask
from colibri.autopilot.guidance.tasks.task import FlightTask
from colibri.common.earth.geodesy import Geodetic, enu_of, is_on_earth
from colibri.common.kernels import cos, sin
from colibri.common.types import Vector
from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.command import TEMPORARILY_REJECTED, Handler, ReceivedCommand
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.refusal import Refusal

MAX_DISTANCE_M = 100_000.0
MAX_HEIGHT_M = 10_000.0
MIN_CLIMB_M = 0.2
"""A lower climb might not lift the feet."""
MIN_RADIUS_M = 1.0
MAX_YAW_RAD = 4.0 * pi
MAX_TURN_DEG = 360.0
_YAW_BEHAVIOURS = range(mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED + 1)
_POINTS = 72
"""Points of a circle checked against the fence."""
_RELATIVE = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)


class Needs(Protocol):
    """Unmet needs of modes."""

    def missing(self) -> tuple[Need, ...]: ...

    def engage(self, peer: Peer, now_us: int) -> None: ...


class MotionCommands:
    """Handlers of the commands to move."""

    def __init__(self, pilot: Pilot, fence: Fence, needs: Needs) -> None:
        self._pilot = pilot
        self._fence = fence
        self._needs = needs
        self._home = pilot.home

    def handlers(self) -> Mapping[int, Handler]:
        return {
            mav.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mav.MAV_CMD_DO_REPOSITION: self._reposition,
            mav.MAV_CMD_DO_ORBIT: self._orbit,
            mav.MAV_CMD_CONDITION_YAW: self._turn,
        }

    def guided_goto(self, latitude_deg: float, longitude_deg: float, altitude_m: float, frame: int) -> Refusal | None:
        """Fly to a place; DroneKit uses a mission item for it."""
        return self._go(latitude_deg, longitude_deg, altitude_m, frame, nan, nan)

    def may_fly_at(self, speed_m_s: float) -> bool:
        return 0.0 < speed_m_s <= self._pilot.behaviour.max_speed_m_s

    def unreachable(self, *places: Vector) -> Refusal | None:
        """Refuse places, if one of them is too far away or outside the fence."""
        for east, north, up in places:
            away = hypot(east, north)
            if not isfinite(away) or away > MAX_DISTANCE_M or not -MAX_HEIGHT_M < up < MAX_HEIGHT_M:
                return Refusal("too far away")
        outside = self._fence.first_outside(places)
        return None if outside is None else outside[1]

    def _fly(self, mode: Mode, task: FlightTask) -> Refusal | None:
        return self._pilot.fly(mode, task, self._needs.missing())

    def _take_off(self, command: ReceivedCommand) -> Refusal | None:
        pilot = self._pilot
        height_m = pilot.ground.height_m + pilot.behaviour.takeoff_height_m
        if not isnan(command.z):
            height_m = self._height_of_takeoff(command)
        if not pilot.ground.height_m + MIN_CLIMB_M <= height_m < MAX_HEIGHT_M:
            return denied("take-off", "not a height above the ground")
        context = pilot.context()
        x, y, _ = context.place
        refusal = self._fence.refusal((x, y, height_m))
        if refusal is not None:
            return denied("take-off", refusal.reason)
        return self._fly(Mode.TAKEOFF, TakeoffTask(height_m, None, context, pilot.behaviour.takeoff_speed_m_s))

    def _height_of_takeoff(self, command: ReceivedCommand) -> float:
        """Return z of ENU, m: above home, but above sea level from QGC, which sends a pitch of -1."""
        above_sea = command.p1 == -1.0 if command.frame is None else command.frame not in _RELATIVE
        return command.z - self._home.origin.altitude_m if above_sea else self._home.position_enu_m[2] + command.z

    def _reposition(self, command: ReceivedCommand) -> Refusal | None:
        """Fly to a place, or stop if all are nan; the mode-change flag is optional."""
        if command.p2 not in (0.0, 1.0) and not isnan(command.p2):
            return denied("reposition", f"a flag of {command.p2:g} is not known")
        if not (isnan(command.p4) or abs(command.p4) <= MAX_YAW_RAD):
            return denied("reposition", "yaw is in radians")
        speed = nan if command.p1 in (-1.0, 0.0) else command.p1
        if not (isnan(speed) or self.may_fly_at(speed)):
            return denied("reposition", f"a speed of {speed:g} m/s")
        if all(map(isnan, (command.x, command.y, command.z, command.p4))):
            return self._fly(Mode.HOLD, HoldTask())
        frame = mav.MAV_FRAME_GLOBAL if command.frame is None else command.frame
        return self._go(command.x, command.y, command.z, frame, command.p4, speed)

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
        refusal = self.unreachable(place) or self._home.refusal(place[2])
        if refusal is not None:
            return Refusal(f"reposition refused: {refusal.reason}")
        yaw = 0.5 * pi - yaw_ned if not isnan(yaw_ned) else context.yaw_rad if only_height else None
        return self._fly(Mode.HOLD, GoToTask(GoTo(place, yaw, None if isnan(speed) else speed), context))

    @property
    def _flies(self) -> bool:
        return self._pilot.state.armed and not self._pilot.ground.standing

    def _orbit(self, command: ReceivedCommand) -> Refusal | None:
        """Fly a circle; z is above sea level in every frame, as in MAVSDK and PX4."""
        pilot = self._pilot
        if not self._flies:
            return denied("orbit", "the vehicle is not flying")
        context = pilot.context()
        x, y, z = context.place
        if not (isnan(command.x) and isnan(command.y)):
            if not is_on_earth(command.x, command.y):
                return denied("orbit", "not a latitude and longitude")
            x, y, _ = enu_of(Geodetic(command.x, command.y, 0.0), self._home.origin)
        if not isnan(command.z):
            z = command.z - self._home.origin.altitude_m
        radius = pilot.behaviour.orbit_radius_m if isnan(command.p1) else command.p1
        speed = None if isnan(command.p2) else abs(command.p2)
        yaw = 0.0 if isnan(command.p3) else command.p3
        circle = Orbit((x, y, z), radius, speed, int(yaw) if yaw in _YAW_BEHAVIOURS else -1)
        refusal = self._no_circle(circle)
        if refusal is not None:
            return denied("orbit", refusal.reason)
        return self._fly(Mode.ORBIT, OrbitTask(circle, context))

    def _no_circle(self, circle: Orbit) -> Refusal | None:
        (x, y, z), radius, speed, yaw_behaviour = circle
        if not MIN_RADIUS_M <= abs(radius) <= MAX_DISTANCE_M:
            return Refusal(f"a radius of {radius:g} m")
        if speed is not None and not self.may_fly_at(speed):
            return Refusal(f"a speed of {speed:g} m/s")
        if yaw_behaviour not in _YAW_BEHAVIOURS:
            return Refusal("no such yaw behaviour")
        angles = (2.0 * pi * point / _POINTS for point in range(_POINTS))
        around = ((x + radius * cos(angle), y + radius * sin(angle), z) for angle in angles)
        return self._home.refusal(z) or self.unreachable(*around)

    def _turn(self, command: ReceivedCommand) -> Refusal | None:
        """Turn clockwise from north, or from the heading if p4 is 1."""
        angle, _, way, relative = (0.0 if isnan(value) else value for value in command[1:5])
        if isnan(command.p1) or abs(angle) > MAX_TURN_DEG or way not in (-1.0, 0.0, 1.0):
            return denied("turn", "not an angle and a direction")
        if relative not in (0.0, 1.0):
            return denied("turn", "1 counts from the heading, 0 from north")
        if not self._flies:
            return Refusal("turn refused: the vehicle is not flying", TEMPORARILY_REJECTED)
        context = self._pilot.context()
        zero_rad = context.yaw_rad if relative else 0.5 * pi
        yaw = zero_rad - radians(-angle if relative and way < 0.0 else angle)
        return self._fly(Mode.HOLD, GoToTask(GoTo(context.place, yaw), context))


def denied(what: str, reason: str) -> Refusal:
    return Refusal(f"{what} refused: {reason}")
