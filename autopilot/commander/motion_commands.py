"""MAVLink commands to move: take-off, reposition, orbit, turn."""

from collections.abc import Mapping
from math import dist, isnan, nan, pi, radians

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import GoTo, Orbit, turn_of
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask
from colibri.autopilot.guidance.tasks.task import FlightTask
from colibri.common.kernels import cos, sin
from colibri.common.types import Vector
from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.command import TEMPORARILY_REJECTED, Handler, ReceivedCommand
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.mavlink.wire.places import ABOVE_TERRAIN, MAX_DISTANCE_M, MAX_HEIGHT_M, far, height_m, read_place, too_far

MIN_CLIMB_M = 0.2  # a lower climb might not lift the feet
MIN_RADIUS_M = 1.0
MAX_YAW_RAD = 4.0 * pi
MAX_TURN_DEG = 360.0
_YAW_BEHAVIOURS = range(mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED + 1)
_POINTS = 72  # points of a circle checked against the fence
_NO_FRAME = (None, mav.MAV_FRAME_MISSION)
_ELSEWHERE_M = 10.0
_NOBODY = Peer(0, 0, 0)
NOT_FLYING = "the vehicle is not flying"


class MotionCommands:
    def __init__(self, pilot: Pilot, fence: Fence, needs: ModeNeeds) -> None:
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

    def takeoff_by_stick(self, height_m: float) -> None:
        """Do nothing; ArduCopter has such take-offs."""

    def guided_goto(self, latitude_deg: float, longitude_deg: float, altitude_m: float, frame: int) -> Refusal | None:
        """Fly to a place; DroneKit uses a mission item for it."""
        place = (latitude_deg, longitude_deg, altitude_m)
        return self._go(ReceivedCommand(mav.MAV_CMD_DO_REPOSITION, nan, nan, nan, nan, *place, frame, _NOBODY, 0), None)

    def speed_refused(self, speed_m_s: float) -> str:
        """Return why a speed cannot be flown; empty if it can."""
        maximum_m_s = self._pilot.behaviour.max_speed_m_s
        return "" if 0.0 < speed_m_s <= maximum_m_s else f"speed {speed_m_s:g} is not within 0 to {maximum_m_s:g} m/s"

    def unreachable(self, *places: Vector) -> Refusal | None:
        """Refuse places if one is too far away or outside the fence."""
        reason = next(filter(None, map(too_far, places)), "")
        outside = None if reason else self._fence.first_outside(places)
        return Refusal(reason) if reason else outside and outside[1]

    def read(self, command: ReceivedCommand, *, above_sea: bool = False) -> Vector | Refusal:
        """Return the place of a command, the vehicle's where it is nan."""
        frame = command.frame
        if frame in _NO_FRAME or (above_sea and frame not in ABOVE_TERRAIN):
            frame = mav.MAV_FRAME_GLOBAL
        assert frame is not None
        home, here = self._home, self._pilot.context().place
        x, y, z = command.x, command.y, command.z
        return read_place(x, y, z, frame, home_up_m=home.position_enu_m[2], origin=home.origin, here=here)

    def warn_elsewhere(self, command: ReceivedCommand, doing: str) -> None:
        """Warn that a command is executed here, not at its place."""
        if (isnan(command.x) and isnan(command.y)) or command.x == command.y == 0.0:
            return
        place, here = self.read(command._replace(z=nan)), self._pilot.context().place
        if isinstance(place, Refusal) or dist(place, here) > _ELSEWHERE_M:
            self._pilot.warn(f"{doing} here, not at {command.x:.6f}, {command.y:.6f}")

    def _fly(self, mode: Mode, task: FlightTask) -> Refusal | None:
        return self._pilot.fly(mode, task, self._needs.missing())

    def _take_off(self, command: ReceivedCommand) -> Refusal | None:
        pilot = self._pilot
        ground_m = pilot.ground.height_m
        up_m = ground_m + pilot.behaviour.takeoff_height_m
        if not isnan(command.z):
            frame = command.frame
            if frame is None or frame in _NO_FRAME:  # QGC, which sends a pitch of -1, means above sea level
                frame = mav.MAV_FRAME_GLOBAL if command.p1 == -1.0 else mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
            up_m = height_m(command.z, frame, self._home.position_enu_m[2], self._home.origin)
        if not ground_m + MIN_CLIMB_M <= up_m < MAX_HEIGHT_M:
            above = f"{round(up_m - ground_m, 3):g} m above the ground"
            return denied("take-off", f"{above} is not within {MIN_CLIMB_M:g} to {MAX_HEIGHT_M:g}")
        context = pilot.context()
        x, y, _ = context.place
        refusal = self._fence.refusal((x, y, up_m))
        if refusal is not None:
            return denied("take-off", refusal.reason)
        refusal = self._fly(Mode.TAKEOFF, TakeoffTask(up_m, None, context, pilot.behaviour.takeoff_speed_m_s))
        if refusal is None:
            self.warn_elsewhere(command, "take-off")
        return refusal

    def _reposition(self, command: ReceivedCommand) -> Refusal | None:
        """Fly to a place, or stop if all are nan."""
        if command.p2 not in (0.0, 1.0) and not isnan(command.p2):
            return denied("reposition", f"flag {command.p2:g} is not 0 or 1")
        if not (isnan(command.p4) or abs(command.p4) <= MAX_YAW_RAD):
            return denied("reposition", f"yaw {command.p4:g} is not within {MAX_YAW_RAD:.1f} rad")
        speed = nan if command.p1 in (-1.0, 0.0) else command.p1
        if not isnan(speed) and self.speed_refused(speed):
            return denied("reposition", self.speed_refused(speed))
        if all(map(isnan, (command.x, command.y, command.z, command.p4))):
            return self._fly(Mode.HOLD, HoldTask())
        return self._go(command, None if isnan(speed) else speed)

    def _go(self, command: ReceivedCommand, speed_m_s: float | None) -> Refusal | None:
        if not self._flies:
            return denied("reposition", NOT_FLYING)
        context, place = self._pilot.context(), self.read(command)
        if isinstance(place, Refusal):
            return denied("reposition", place.reason)
        refusal = self.unreachable(place) or self._home.refusal(place[2])
        if refusal is not None:
            return denied("reposition", refusal.reason)
        keeps_heading = isnan(command.x) and isnan(command.y)
        yaw = 0.5 * pi - command.p4 if not isnan(command.p4) else context.yaw_rad if keeps_heading else None
        refusal = self._fly(Mode.HOLD, GoToTask(GoTo(place, yaw, speed_m_s), context))
        if refusal is None:
            self.warn_of("reposition", place)
        return refusal

    def warn_of(self, what: str, place: Vector) -> None:
        """Warn of a place that may be a mistake."""
        for remark in (far(place, self._home.position_enu_m), self._home.remark(place[2])):
            if remark:
                self._pilot.warn(f"{what}: {remark}")

    @property
    def _flies(self) -> bool:
        return self._pilot.state.armed and not self._pilot.ground.standing

    def _orbit(self, command: ReceivedCommand) -> Refusal | None:
        """Fly a circle; z is above sea level, as in PX4, except in frames above terrain."""
        pilot = self._pilot
        if not self._flies:
            return denied("orbit", NOT_FLYING)
        context, center = pilot.context(), self.read(command, above_sea=True)
        if isinstance(center, Refusal):
            return denied("orbit", center.reason)
        radius = pilot.behaviour.orbit_radius_m if isnan(command.p1) else command.p1
        speed = None if isnan(command.p2) else abs(command.p2)
        yaw = 0.0 if isnan(command.p3) else command.p3
        if yaw not in _YAW_BEHAVIOURS:
            return denied("orbit", f"yaw behaviour {yaw:g} is not within 0 to {_YAW_BEHAVIOURS[-1]}")
        circle = Orbit(center, radius, speed, int(yaw))
        refusal = self._no_circle(circle)
        if refusal is not None:
            return denied("orbit", refusal.reason)
        refusal = self._fly(Mode.ORBIT, OrbitTask(circle, context))
        if refusal is None:
            self.warn_of("orbit", center)
        return refusal

    def _no_circle(self, circle: Orbit) -> Refusal | None:
        (x, y, z), radius, speed, _ = circle
        if not MIN_RADIUS_M <= abs(radius) <= MAX_DISTANCE_M:
            return Refusal(f"radius {radius:g} is not within {MIN_RADIUS_M:g} to {MAX_DISTANCE_M:g} m")
        if speed is not None and self.speed_refused(speed):
            return Refusal(self.speed_refused(speed))
        angles = (2.0 * pi * point / _POINTS for point in range(_POINTS))
        around = ((x + radius * cos(angle), y + radius * sin(angle), z) for angle in angles)
        return self._home.refusal(z) or self.unreachable(*around)

    def _turn(self, command: ReceivedCommand) -> Refusal | None:
        """Turn clockwise from north, or from the heading if p4 is 1; p3 is the direction."""
        angle, _, way, relative = (0.0 if isnan(value) else value for value in command[1:5])
        if isnan(command.p1) or abs(angle) > MAX_TURN_DEG:
            return denied("turn", f"angle {command.p1:g} is not within {MAX_TURN_DEG:g} degrees")
        if way not in (-1.0, 0.0, 1.0):
            return denied("turn", f"direction {way:g} is not -1, 0 or 1")
        if relative not in (0.0, 1.0):
            return denied("turn", f"{relative:g} is not 1, from the heading, or 0, from north")
        if not self._flies:
            return Refusal(f"turn refused: {NOT_FLYING}", TEMPORARILY_REJECTED)
        context = self._pilot.context()
        zero_rad = context.yaw_rad if relative else 0.5 * pi
        yaw = zero_rad - radians(-angle if relative and way < 0.0 else angle)
        return self._fly(Mode.HOLD, GoToTask(GoTo(context.place, yaw, turn=turn_of(angle, way)), context))


def denied(what: str, reason: str) -> Refusal:
    return Refusal(f"{what} refused: {reason}")
