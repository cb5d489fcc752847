"""Commands to the autopilot as a system, among them simulated calibrations."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version as version_of_package
from math import pi

from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.pilot import Pilot
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.command import TEMPORARILY_REJECTED, UNSUPPORTED, Handler, ReceivedCommand
from colibri.mavlink.services.identity import Identity, autopilot_version, banner, version_of
from colibri.mavlink.services.shell import Command as ShellCommand
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.mavlink.wire.places import misplaced, misplaced_height

VERSION = version_of_package("colibri-sitl")
REBOOT, SHUT_DOWN = 1.0, 2.0
_STEP_US = 100_000
_STEPS = 10


class SystemCommands:
    """System commands; `restart` is 0 until requested."""

    def __init__(
        self, pilot: Pilot, missions: Missions, parameters: Parameters, *, identity: Identity, system_id: int
    ) -> None:
        self._pilot, self._missions, self._parameters = pilot, missions, parameters
        self._calibration = Calibration()
        self.banner = banner(identity, VERSION)
        self.version: Sequence[object] = autopilot_version(identity, version_of(VERSION), system_id)
        self.restart = 0.0

    def handlers(self) -> Mapping[int, Handler]:
        return {
            mav.MAV_CMD_PREFLIGHT_CALIBRATION: self._calibrate,
            mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._restart,
            mav.MAV_CMD_PREFLIGHT_STORAGE: self._storage,
            mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN: lambda it: self.set_origin(Geodetic(it.x, it.y, it.z)),
        }

    def shell(self) -> Mapping[str, ShellCommand]:
        return {"ver": lambda _: self.banner + "\n", "status": lambda _: self._status(), "param": self._param}

    def reboot(self) -> None:
        self.restart = REBOOT

    def poll(self, now_us: int) -> list[str]:
        return self._calibration.poll(now_us)

    def set_origin(self, place: Geodetic) -> Refusal | None:
        wrong = misplaced(place.latitude_deg, place.longitude_deg) or misplaced_height(place.altitude_m)
        if wrong or self._pilot.state.armed:
            return Refusal(f"origin refused: {wrong or 'the rotors are armed'}")
        self._missions.move_origin(place)
        return None

    def _calibrate(self, command: ReceivedCommand) -> Refusal | None:
        return self._calibration.begin(command, armed=self._pilot.state.armed)

    def _restart(self, command: ReceivedCommand) -> Refusal | None:
        if self._pilot.state.armed:
            return Refusal("restart refused: the rotors are armed")
        if command.p1 not in (REBOOT, SHUT_DOWN):
            return Refusal(f"restart refused: {command.p1:g} is not 1, restart, or 2, shut down")
        self.restart = command.p1
        return None

    def _storage(self, command: ReceivedCommand) -> Refusal | None:
        if command.p1 == 2.0:
            if self._pilot.state.armed:
                return Refusal("parameters refused: the rotors are armed")
            self._parameters.reset()
        return None if command.p1 in (0.0, 1.0, 2.0) else Refusal(f"storage refused: {command.p1:g} is not 0, 1 or 2")

    def _status(self) -> str:
        mode, armed = self._pilot.state
        x, y, z = self._pilot.context().state.position_enu_m
        reasons = "; ".join(self._pilot.readiness.refusals()) or "ready to arm"
        yaw_deg = (90.0 - self._pilot.context().state.euler[2] * 180.0 / pi) % 360.0
        return (
            f"{self.banner}\nmode {mode}, {'armed' if armed else 'disarmed'}, {reasons}\n"
            f"east {x:.2f} north {y:.2f} up {z:.2f} m, heading {yaw_deg:.0f} degrees\n"
        )

    def _param(self, arguments: list[str]) -> str:
        shown = arguments[1:] if arguments[:1] == ["show"] else arguments
        names = [p.name for p in self._parameters if not shown or p.name.startswith(shown[0].upper().rstrip("*"))]
        return "".join(f"{name} {self._parameters[name]:g}\n" for name in names) or "no such parameter\n"


class Calibration:
    """Calibrates in appearance, with PX4's "[cal] ..." texts, which ground stations parse."""

    def __init__(self) -> None:
        self._kind = ""
        self._step = 0
        self._due_us = 0

    def begin(self, command: ReceivedCommand, *, armed: bool) -> Refusal | None:
        if armed:
            return Refusal("calibration refused: the rotors are armed")
        chosen = (command.p1, command.p2, command.p3, command.p4, command.x, command.y, command.z)
        kind = _kind_of(chosen)
        if kind is None:
            return Refusal("calibration refused: only gyro, mag, accel and level are known", UNSUPPORTED)
        if kind and self._kind:
            return Refusal("calibration refused: another one is under way", TEMPORARILY_REJECTED)
        if not kind:
            cancelled, self._kind = self._kind, ""
            self._step = -1 if cancelled else 0
        else:
            self._kind, self._step, self._due_us = kind, 0, command.now_us
        return None

    def poll(self, now_us: int) -> list[str]:
        if self._step == -1:
            self._step = 0
            return ["[cal] calibration cancelled"]
        if not self._kind or now_us < self._due_us:
            return []
        self._due_us = now_us + _STEP_US
        step, self._step = self._step, self._step + 1
        if step == 0:
            return [f"[cal] calibration started: 2 {self._kind}"]
        if step <= _STEPS:
            return [f"[cal] progress <{100 * step // _STEPS}>"]
        kind, self._kind, self._step = self._kind, "", 0
        return [f"[cal] calibration done: {kind}"]


def _kind_of(p: tuple[float, ...]) -> str | None:
    given = [0.0 if value != value else value for value in p]  # nan: not given
    chosen = [(place, value) for place, value in enumerate(given) if value != 0.0]
    if not chosen:
        return ""
    known = {(0, 1.0): "gyro", (1, 1.0): "mag", (4, 1.0): "accel", (4, 2.0): "level"}
    return known.get(chosen[0]) if len(chosen) == 1 else None
