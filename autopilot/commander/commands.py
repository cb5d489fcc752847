"""MAVLink commands to arm, change mode or speed, and set home."""

from collections.abc import Callable, Mapping
from math import isnan
from typing import NamedTuple

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_selection import ModeSelection
from colibri.autopilot.commander.mode_tasks import ModeTasks
from colibri.autopilot.commander.motion_commands import MotionCommands, denied
from colibri.autopilot.commander.needs import ModeNeeds
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.commander.rules.shown_modes import PX4_MODES, ModeBook
from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.command import FAILED, UNSUPPORTED, Handler, ReceivedCommand
from colibri.mavlink.setpoints.setpoints import OffboardSetpoint
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.mavlink.wire.places import read_place

FORCE_MAGIC = 21196
_OVER_GROUND = (mav.SPEED_TYPE_AIRSPEED, mav.SPEED_TYPE_GROUNDSPEED)
"""SPEED_TYPE: equivalent without an airspeed sensor."""
_SAME_SPEED, _DEFAULT_SPEED = -1.0, -2.0


class Commanded(NamedTuple):
    """What commands act on, and what an identity makes of them."""

    pilot: Pilot
    fence: Fence
    missions: Missions
    needs: ModeNeeds
    tasks: ModeTasks
    parameters: Parameters
    book: ModeBook = PX4_MODES
    banner: tuple[str, ...] = ()


class Commands:
    """Handlers of the commands of ground stations.

    Attributes:
        taken: Takes setpoints, where a mode flies them by itself.
        exempt: Returns failsafes without action in this mode; the radio is then needed in every mode.
    """

    def __init__(self, parts: Commanded) -> None:
        pilot, fence, self._missions, needs, *_ = parts
        self._pilot, self._fence, self._needs = pilot, fence, needs
        self._home = pilot.home
        self.modes = ModeSelection(parts.book, pilot, needs)
        self.taken: Callable[[OffboardSetpoint | None], None] | None = None
        self.exempt: Callable[[], Mapping[Condition, str]] | None = None
        self.motion = MotionCommands(pilot, fence, needs)

    def handlers(self) -> Mapping[int, Handler]:
        return {
            **self.motion.handlers(),
            mav.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mav.MAV_CMD_DO_SET_MODE: self._set_mode,
            mav.MAV_CMD_NAV_LAND: lambda command: self._select_here(Mode.LAND, command),
            mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self.select(Mode.RETURN),
            mav.MAV_CMD_NAV_LOITER_UNLIM: lambda command: self._select_here(Mode.HOLD, command),
            mav.MAV_CMD_MISSION_START: self._start_mission,
            mav.MAV_CMD_DO_PAUSE_CONTINUE: self._pause_or_go_on,
            mav.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mav.MAV_CMD_DO_SET_HOME: self._set_home,
            mav.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mav.MAV_CMD_RUN_PREARM_CHECKS: self._check,
        }

    def select(self, mode: Mode) -> Refusal | None:
        return self.modes.select(self.modes.book.chosen[mode])

    def _select_here(self, mode: Mode, command: ReceivedCommand) -> Refusal | None:
        refusal = self.select(mode)
        if refusal is None:
            self.motion.warn_elsewhere(command, mode)
        return refusal

    def _arm_disarm(self, command: ReceivedCommand) -> Refusal | None:
        force = command.p2 == FORCE_MAGIC
        if command.p1 == 1.0:
            self._judge_fence()
            return self.modes.arm(force=force)
        if command.p1 == 0.0:
            return self._pilot.disarm(force=force)
        return denied("arming", f"{command.p1:g} is not 1, to arm, or 0, to disarm")

    def _set_mode(self, command: ReceivedCommand) -> Refusal | None:
        self._needs.engage(command.peer, command.now_us)
        chosen = self.modes.book.by_command(command.p1, command.p2, 0.0 if isnan(command.p3) else command.p3)
        return chosen if isinstance(chosen, Refusal) else self.modes.select(*chosen)

    def set_custom_mode(self, base_mode: int, custom_mode: int) -> Refusal | None:
        chosen = self.modes.book.by_message(base_mode, custom_mode)
        return chosen if isinstance(chosen, Refusal) else self.modes.select(*chosen)

    def _start_mission(self, command: ReceivedCommand) -> Refusal | None:
        """Fly the mission to its end from item p1, as in PX4; nan or -1: from the current one."""
        first, last, total = command.p1, command.p2, self._missions.total
        if not total:
            return denied("mission", Need.MISSION.value)
        if not isnan(first) and first not in range(-1, total):
            return denied("mission", f"first item {first:g} is not within 0 to {total - 1}")
        if not isnan(last) and last not in (-1.0, 0.0, total - 1, total):
            return denied("mission", f"last item {last:g} is not {total - 1}, its end")
        refusal = self.select(Mode.MISSION)
        if refusal is None and first >= 0.0:
            self._missions.executor.set_current(int(first), False)
        return refusal

    def _pause_or_go_on(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 0.0:
            return self.select(Mode.HOLD)
        if command.p1 == 1.0:
            return self.select(Mode.MISSION)
        return denied("pause", f"{command.p1:g} is not 0, to pause, or 1, to go on")

    def _change_speed(self, command: ReceivedCommand) -> Refusal | None:
        kind, speed, _, relative = command[1:5]
        if kind not in _OVER_GROUND and not isnan(kind):
            return Refusal(f"speed refused: type {kind:g} is not 0 or 1, over ground", UNSUPPORTED)
        if relative == 1.0:
            return Refusal("speed refused: relative 1 is not 0, absolute", UNSUPPORTED)
        if speed == _DEFAULT_SPEED:
            self._pilot.speed_m_s = None
        elif not self.motion.speed_refused(speed):
            self._pilot.speed_m_s = speed
        elif speed != _SAME_SPEED:
            return denied("speed", self.motion.speed_refused(speed))
        return None

    def _set_home(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 1.0:
            state = self._pilot.context().state
            self._missions.move_home(state.position_enu_m, state.euler[2], state)
            return None
        if command.p1 != 0.0 and not isnan(command.p1):
            return denied("home", f"{command.p1:g} is not 1, here, or 0, there")
        for name, value in (("latitude", command.x), ("longitude", command.y), ("altitude", command.z)):
            if isnan(value):
                return denied("home", f"{name} is missing")
        return self._move_home(self.motion.read(command, above_sea=True))

    def move_home(self, place: Geodetic) -> Refusal | None:
        home, frame = self._home, mav.MAV_FRAME_GLOBAL
        return self._move_home(read_place(*place, frame, home_up_m=0.0, origin=home.origin, here=home.position_enu_m))

    def _move_home(self, place: Vector | Refusal) -> Refusal | None:
        if isinstance(place, Refusal):
            return denied("home", place.reason)
        refusal = self.motion.unreachable(place)
        if refusal is not None:
            return denied("home", refusal.reason)
        self._missions.move_home(place, self._home.yaw_rad, self._pilot.context().state)
        return None

    def _terminate(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 1.0:
            return self._pilot.disarm(force=True)
        return denied("termination", f"{command.p1:g} is not 1; it is never undone")

    def _check(self, _command: ReceivedCommand) -> Refusal | None:
        self._judge_fence()
        reasons = self._pilot.readiness.refusals()
        return Refusal("Preflight Fail: " + "; ".join(reasons), FAILED) if reasons else None

    def _judge_fence(self) -> None:
        vehicle, readiness = self._pilot.sensed.vehicle, self._pilot.readiness
        if vehicle is not None:
            outside = self._fence.arming_refusal(vehicle.position_enu_m)
            readiness.inputs = readiness.inputs._replace(outside_fence=outside)
