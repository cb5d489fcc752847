"""ArduCopter's commands, with the results that its clients expect.

Source: ArduCopter's GCS_MAVLink_Copter.cpp and GCS_Common.cpp, 4.6.
"""

from collections.abc import Iterator, Mapping
from math import isnan, radians

from colibri.autopilot.commander.commands import FORCE_MAGIC, Commanded, Commands
from colibri.autopilot.commander.copter_motion import ALT_HOLD, AUTO, CIRCLE, LOITER, POSHOLD, CopterMotion
from colibri.autopilot.commander.mode_selection import THROTTLE_UP
from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.mission.items import DO_AUX_FUNCTION
from colibri.autopilot.guidance.tasks.guided import GuidedSettings
from colibri.mavlink.parameters.store import ParamError
from colibri.mavlink.services.command import DENIED, FAILED, UNSUPPORTED, Handler, ReceivedCommand
from colibri.mavlink.services.statustext import CRITICAL, INFO
from colibri.mavlink.wire.dialect import Refusal, mav

DO_SEND_BANNER = 42428  # of the dialect ardupilotmega
_BY_THRUST, _YAW_STAYS, _WITHOUT_THROTTLE = 8, 0, 2
_MAX_SPIN = 0.3
_POSITIVE = ("PSC_POSXY_P", "PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I")
_ALT_MAX, _CIRCLE = 1, 2
STABILIZE, LAND, GUIDED_NOGPS = 0, 9, 20
_RADIO, _STATION = Condition.STICKS_LOST, Condition.STATION_LOST
_CONTINUES_GUIDED = ((4, _RADIO, "Guided Mode"),)
_CONTINUES = {
    AUTO: ((1, _RADIO, "Auto"), (2, _STATION, "Auto Mode")),
    LAND: ((8, _RADIO, "Landing"), (8, _STATION, "Landing")),
    **dict.fromkeys((STABILIZE, ALT_HOLD, LOITER, POSHOLD), ((16, _STATION, "Pilot Control"),)),
}
"""What continues in spite of a loss, by mode and bit of FS_OPTIONS."""
_WITHOUT_POSITION, _LANDS_ALWAYS = (STABILIZE, ALT_HOLD, GUIDED_NOGPS), 3
_ARM_FORCE = (FORCE_MAGIC, 2989)
_GROUND_SPEED, _CLIMB, _DESCENT = 1.0, 2.0, 3.0
_MAX_TAG = 65535
_TESTED_MOTORS = range(1, 9)
_CALIBRATED = (1.0, 2.0, 4.0, 76.0)  # accelerometer, level, accelerometer at rest, the present values
_ACCEPTED = (
    *(mav.MAV_CMD_DO_SET_RELAY, mav.MAV_CMD_DO_REPEAT_SERVO, mav.MAV_CMD_DO_REPEAT_RELAY, mav.MAV_CMD_DO_SET_ROI),
    *(mav.MAV_CMD_DO_SET_ROI_LOCATION, mav.MAV_CMD_DO_SET_ROI_NONE, mav.MAV_CMD_DO_MOUNT_CONTROL),
    *(mav.MAV_CMD_DO_MOUNT_CONFIGURE, mav.MAV_CMD_DO_DIGICAM_CONTROL, mav.MAV_CMD_DO_GRIPPER, DO_AUX_FUNCTION),
)
"""Commands that are accepted and have no effect."""


class CopterCommands(Commands):
    motion: CopterMotion

    def __init__(self, parts: Commanded) -> None:
        super().__init__(parts)
        pilot, fence, _, needs, tasks, parameters, _, self._banner = parts
        self._parameters = parameters
        self.motion = CopterMotion(
            pilot, fence, needs, self.modes, lambda: tasks.guided(self._guided_settings), self._circle
        )
        self.modes.enters[CIRCLE] = self.motion.circle
        self.modes.starts_armed = lambda: bool(int(parameters["AUTO_OPTIONS"]) & _WITHOUT_THROTTLE)
        self.taken, self.exempt = self.motion.setpoint, self._exempt
        pilot.readiness.further = self._prearm
        pilot.stays_armed = self._throttle_raised
        self.modes.select(int(parameters["INITIAL_MODE"]))

    def _guided_settings(self) -> GuidedSettings:
        value = self._parameters
        return GuidedSettings(
            round(value["GUID_TIMEOUT"] * 1e6),
            value["WP_YAW_BEHAVIOR"] != _YAW_STAYS,
            bool(int(value["GUID_OPTIONS"]) & _BY_THRUST),
            value["MOT_THST_HOVER"],
        )

    def _circle(self) -> tuple[float, float]:
        radius_m = max(0.01 * self._parameters["CIRCLE_RADIUS"], 1.0)
        return radius_m, radians(self._parameters["CIRCLE_RATE"]) * radius_m

    def _exempt(self) -> Mapping[Condition, str]:
        """Return the losses without action and what continues, by FS_OPTIONS and FS_THR_ENABLE: events.cpp."""
        value = self._parameters
        options = int(value["FS_OPTIONS"])
        rows = _CONTINUES_GUIDED if self.motion.guided else _CONTINUES.get(self.modes.shown.number, ())
        exempt = {loss: continues for bit, loss, continues in rows if options & bit}
        if not value["FS_THR_ENABLE"]:
            exempt[_RADIO] = ""
        if self.modes.shown.number in _WITHOUT_POSITION and value["FS_EKF_ACTION"] != _LANDS_ALWAYS:
            exempt[Condition.GPS_LOST] = self.modes.shown.name
        return exempt

    def _throttle_raised(self) -> bool:
        sticks = self._pilot.sensed.steered.sticks
        return sticks is not None and sticks.thrust > THROTTLE_UP

    def _prearm(self) -> Iterator[str]:
        """Yield the reasons of ArduCopter's own arming checks."""
        value = self._parameters
        if not value["ARMING_CHECK"]:
            return
        if value["MOT_PWM_MIN"] >= value["MOT_PWM_MAX"]:
            yield "Motors: Check MOT_PWM_MIN and MOT_PWM_MAX"
        if value["MOT_SPIN_MIN"] > _MAX_SPIN:
            yield f"Motors: MOT_SPIN_MIN too high {value['MOT_SPIN_MIN']:.2f} > {_MAX_SPIN:.1f}"
        if value["MOT_SPIN_ARM"] > value["MOT_SPIN_MIN"]:
            yield "Motors: MOT_SPIN_ARM > MOT_SPIN_MIN"
        for name in _POSITIVE:
            if value[name] <= 0.0:
                yield f"{name} must be > 0"
        if self.modes.shown.number == AUTO and not self._missions.total:
            yield "Mode requires mission"
        channels = self._pilot.sensed.steered.channels
        if self._pilot.sensed.now_us and not channels:
            yield "RC not found"
        elif channels and value["FS_THR_ENABLE"] and channels[2] < value["FS_THR_VALUE"]:
            yield "Throttle below failsafe"
        if value["FENCE_ENABLE"]:
            kinds = int(value["FENCE_TYPE"])
            if kinds & _CIRCLE and value["FENCE_RADIUS"] < 0.0:
                yield "Invalid Circle FENCE_RADIUS value"
            if kinds & _ALT_MAX and value["FENCE_ALT_MAX"] < 0.0:
                yield "Invalid FENCE_ALT_MAX value"

    def handlers(self) -> Mapping[int, Handler]:
        known = super().handlers()
        return {
            **known,
            mav.MAV_CMD_NAV_VTOL_TAKEOFF: known[mav.MAV_CMD_NAV_TAKEOFF],
            **dict.fromkeys(_ACCEPTED, lambda _: None),
            mav.MAV_CMD_NAV_VTOL_LAND: lambda _: self.select(Mode.LAND),
            mav.MAV_CMD_DO_FENCE_ENABLE: self._enable_fence,
            mav.MAV_CMD_DO_SET_SERVO: lambda it: (
                None if it.p1 >= 1.0 else Refusal(f"servo: {it.p1:g} is not 1 or more", FAILED)
            ),
            mav.MAV_CMD_DO_MOTOR_TEST: self._test_motors,
            mav.MAV_CMD_DO_JUMP_TAG: self._jump_to_tag,
            mav.MAV_CMD_DO_LAND_START: lambda _: Refusal("No landing sequence found", FAILED),
            mav.MAV_CMD_PREFLIGHT_CALIBRATION: self._calibrate,
            DO_SEND_BANNER: self._send_banner,
        }

    def _arm_disarm(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 1.0 and command.p2 in _ARM_FORCE:
            command = command._replace(p2=FORCE_MAGIC)
        refusal = super()._arm_disarm(command)
        return refusal and refusal._replace(result=FAILED)

    def _start_mission(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 not in (0.0,) or (command.p2 != 0.0 and not isnan(command.p2)):
            return Refusal("mission start: parameters 1 and 2 must be 0", DENIED)
        refusal = None if self.modes.shown.number == AUTO else self.modes.select(AUTO)
        if refusal is None and self._pilot.state.armed:
            refusal = self.modes.start()
        return refusal and refusal._replace(result=FAILED)

    def _pause_or_go_on(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 not in (0.0, 1.0):
            return Refusal(f"pause: {command.p1:g} is not 0, to pause, or 1, to go on", DENIED)
        pauses, task = command.p1 == 0.0, self.motion.task
        if self.modes.shown.number == AUTO:
            return self.modes.fly(Mode.HOLD) if pauses else self.modes.start()
        if not self.motion.guided:
            return Refusal("pause: only in AUTO and GUIDED", FAILED)
        if task is not None:
            task.paused = pauses
        return None

    def _change_speed(self, command: ReceivedCommand) -> Refusal | None:
        kind = _GROUND_SPEED if command.p1 in (0.0, _GROUND_SPEED) or isnan(command.p1) else command.p1
        if not command.p2 > 0.0:
            return Refusal(f"speed: {command.p2:g} m/s is not above 0", DENIED)
        names = {_CLIMB: "WPNAV_SPEED_UP", _DESCENT: "WPNAV_SPEED_DN"}
        if kind in names:
            refused = isinstance(self._parameters.propose(names[kind], 100.0 * command.p2), ParamError)
            return Refusal(f"speed: {command.p2:g} m/s is out of range", DENIED) if refused else None
        if kind != _GROUND_SPEED:
            return Refusal(f"speed: type {kind:g} is not 0 to 3", DENIED)
        self._pilot.speed_m_s = command.p2
        return None

    def _set_home(self, command: ReceivedCommand) -> Refusal | None:
        """Set home; a place of 0, 0 is here."""
        here = command.x == command.y == 0.0
        return super()._set_home(command._replace(p1=1.0) if here else command)

    def _terminate(self, command: ReceivedCommand) -> Refusal | None:
        return super()._terminate(command) if command.p1 > 0.5 else Refusal("termination: 1 terminates", FAILED)

    def _check(self, _command: ReceivedCommand) -> Refusal | None:
        """Report each failed check; accepted also with failures."""
        self._judge_fence()
        for reason in self._pilot.readiness.refusals():
            self._pilot.say(CRITICAL, f"PreArm: {reason}")
        return None

    def _enable_fence(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 not in (0.0, 1.0, 2.0):
            return Refusal(f"fence: {command.p1:g} is not 0 to 2", FAILED)
        self._parameters.propose("FENCE_ENABLE", int(command.p1 == 1.0))
        return None

    def _send_banner(self, _command: ReceivedCommand) -> Refusal | None:
        for text in self._banner:
            self._pilot.say(INFO, text)
        return None

    def _jump_to_tag(self, command: ReceivedCommand) -> Refusal | None:
        executor, valid = self._missions.executor, 0.0 <= command.p1 <= _MAX_TAG
        if command.p1 in executor.tags:
            return executor.set_current(executor.tags[command.p1])
        return Refusal(f"mission: there is no tag {command.p1:g}", FAILED if valid else DENIED)

    def _calibrate(self, command: ReceivedCommand) -> Refusal | None:
        """Accept calibrations of gyroscopes, barometers and accelerometers, without effect."""
        if self._pilot.state.armed:
            return Refusal("calibration refused: the rotors are armed", DENIED)
        if command.p3 == 1.0:
            self._pilot.say(INFO, "Updating barometer calibration")
            self._pilot.say(INFO, "Barometer calibration complete")
        elif command.p1 != 1.0 and command.x not in _CALIBRATED and command.p2 != _CALIBRATED[-1]:
            return Refusal("calibration refused: only gyro, pressure, accel and level are known", UNSUPPORTED)
        return None

    def _test_motors(self, command: ReceivedCommand) -> Refusal | None:
        if self._pilot.state.armed:
            return Refusal("Motor Test: vehicle not landed", FAILED)
        if command.p1 not in _TESTED_MOTORS:
            return Refusal(f"Motor Test: motor {command.p1:g} is not 1 to 8", FAILED)
        self._pilot.say(INFO, "starting motor test")
        self._pilot.say(INFO, "finished motor test")
        return None
