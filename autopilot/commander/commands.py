"""MAVLink commands to arm, change mode or speed, and set home."""

from collections.abc import Mapping
from math import isfinite, isnan

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.motion_commands import MotionCommands, Needs, denied
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import Mode, mode_of, mode_of_custom
from colibri.common.earth.geodesy import Geodetic, enu_of, is_on_earth
from colibri.mavlink.services.command import FAILED, UNSUPPORTED, Handler, ReceivedCommand
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.refusal import Refusal

FORCE_MAGIC = 21196
_OVER_GROUND = (mav.SPEED_TYPE_AIRSPEED, mav.SPEED_TYPE_GROUNDSPEED)
"""SPEED_TYPE: equivalent without an airspeed sensor."""
_SAME_SPEED, _DEFAULT_SPEED = -1.0, -2.0
_CUSTOM = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


class Commands:
    """Handlers of the commands of ground stations."""

    def __init__(self, pilot: Pilot, fence: Fence, needs: Needs) -> None:
        self._pilot = pilot
        self._needs = needs
        self._home = pilot.home
        self.motion = MotionCommands(pilot, fence, needs)

    def handlers(self) -> Mapping[int, Handler]:
        return {
            **self.motion.handlers(),
            mav.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mav.MAV_CMD_DO_SET_MODE: self._set_mode,
            mav.MAV_CMD_NAV_LAND: lambda _: self.select(Mode.LAND),
            mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self.select(Mode.RETURN),
            mav.MAV_CMD_NAV_LOITER_UNLIM: lambda _: self.select(Mode.HOLD),
            mav.MAV_CMD_MISSION_START: lambda _: self.select(Mode.MISSION),
            mav.MAV_CMD_DO_PAUSE_CONTINUE: self._pause_or_go_on,
            mav.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mav.MAV_CMD_DO_SET_HOME: self._set_home,
            mav.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mav.MAV_CMD_RUN_PREARM_CHECKS: self._check,
        }

    def select(self, mode: Mode | None) -> Refusal | None:
        if mode is None:
            return Refusal("this vehicle has no such mode", UNSUPPORTED)
        return self._pilot.select(mode, self._needs.missing())

    def _arm_disarm(self, command: ReceivedCommand) -> Refusal | None:
        force = command.p2 == FORCE_MAGIC
        if command.p1 == 1.0:
            return self._pilot.arm(self._needs.missing(), force=force)
        if command.p1 == 0.0:
            return self._pilot.disarm(force=force)
        return Refusal("arm with 1, disarm with 0")

    def _set_mode(self, command: ReceivedCommand) -> Refusal | None:
        self._needs.engage(command.peer, command.now_us)
        numbers = (command.p1, command.p2, 0.0 if isnan(command.p3) else command.p3)
        if not all(0.0 <= number < 256.0 and number == int(number) for number in numbers):
            return Refusal("mode refused: not a PX4 main and sub mode")
        base, main, sub = map(int, numbers)
        if not base & _CUSTOM:
            return Refusal("mode refused: only custom modes are known", UNSUPPORTED)
        return self.select(mode_of(main, sub))

    def set_custom_mode(self, base_mode: int, custom_mode: int) -> Refusal | None:
        return self.select(mode_of_custom(custom_mode) if base_mode & _CUSTOM else None)

    def _pause_or_go_on(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 0.0:
            return self.select(Mode.HOLD)
        return self.select(Mode.MISSION) if command.p1 == 1.0 else Refusal("pause with 0, go on with 1")

    def _change_speed(self, command: ReceivedCommand) -> Refusal | None:
        """Set the ground speed; -1 keeps it, -2 selects the parameters' speed."""
        kind, speed, _, relative = command[1:5]
        if kind not in _OVER_GROUND and not isnan(kind):
            return Refusal("speed refused: only that over ground can be set", UNSUPPORTED)
        if relative == 1.0:
            return Refusal("speed refused: only absolute ones can be set", UNSUPPORTED)
        if speed == _DEFAULT_SPEED:
            self._pilot.speed_m_s = None
        elif self.motion.may_fly_at(speed):
            self._pilot.speed_m_s = speed
        elif speed != _SAME_SPEED:
            return denied("speed", f"{speed:g} m/s")
        return None

    def _set_home(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 1.0:
            state = self._pilot.context().state
            self._home.move(state.position_enu_m, state.euler[2])
            return None
        if command.p1 != 0.0 and not isnan(command.p1):
            return denied("home", "1 is here, 0 is there")
        if not is_on_earth(command.x, command.y) or not isfinite(command.z):
            return denied("home", "not a latitude, longitude and altitude")
        return self.move_home(Geodetic(command.x, command.y, command.z))

    def move_home(self, place: Geodetic) -> Refusal | None:
        home = enu_of(place, self._home.origin)
        refusal = self.motion.unreachable(home)
        if refusal is not None:
            return Refusal(f"home refused: {refusal.reason}")
        self._home.move(home, self._home.yaw_rad)
        return None

    def _terminate(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 1.0:
            return self._pilot.disarm(force=True)
        return Refusal("flight terminated by 1 alone, and never undone")

    def _check(self, command: ReceivedCommand) -> Refusal | None:
        del command
        reasons = self._pilot.readiness.refusals()
        return Refusal("not ready: " + "; ".join(reasons), FAILED) if reasons else None
