"""Every way in which a companion's flight ends, provoked on real PX4 with its own physics, one after another.

`python -m tests.peers.endings PROGRAM FOLDER`, in a network namespace with loopback alone: PX4 binds to all addresses.
What happened is in FOLDER/endings.json. Both run at half of real time, which a busy computer still keeps to; all times
are the vehicle's.
"""

import json
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import STDOUT, Popen
from time import perf_counter
from typing import Any, NamedTuple

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.common.types import Address
from colibri.companion.guide import Companion
from colibri.companion.settings import CompanionSettings
from colibri.companion.stacks.px4_modes import HOLD
from colibri.companion.supervision.limits import FlightLimits
from colibri.companion.supervision.phases import Phase
from colibri.mavlink.links.link import GroundLink
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import Bits, Codec, mav
from colibri.plant.vehicle.description import load_vehicle

INSTANCE = 8
SPEED = 0.5
SETTINGS = {
    "PX4_SYS_AUTOSTART": "10040",
    "PX4_SIM_MODEL": "sihsim_quadx",
    "PX4_SIM_SPEED_FACTOR": str(SPEED),
    "PX4_PARAM_COM_RC_IN_MODE": "4",
    "PX4_PARAM_NAV_DLL_ACT": "0",
    "PX4_PARAM_COM_RCL_EXCEPT": "7",
    "PX4_PARAM_CBRK_SUPPLY_CHK": "894281",
    "PX4_PARAM_COM_LOW_BAT_ACT": "0",
    "PX4_PARAM_SIM_BAT_MIN_PCT": "90",
    "PX4_PARAM_SDLOG_BACKEND": "0",
    "PX4_PARAM_EKF2_NOAID_TOUT": "1000000",
}
"""The logger is off, which holds PX4 up on a slow disk; an estimate without aid is lost after a second, not five."""
RETURN = (1.0, 4.0, 5.0)
"""The mode that the pilot chooses; PX4 leaves those that need sticks at once where it has none."""
GIVE_UP_S = 90.0
FLIES_S = 3.0
"""So long it flies before it is disturbed."""
PATIENT = FlightLimits(max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0)
"""Where it is not the lateness that counts: a busy computer is late now and then."""


class Case(NamedTuple):
    """One way to end.

    Attributes:
        limits: Of the flight.
        disturb: What is done to it once it flies.
    """

    limits: FlightLimits
    disturb: Callable[["Bench"], None]


@dataclass
class Bench:
    """A vehicle, its companion and its pilot.

    Attributes:
        process: PX4's.
        link: The companion's.
        pilot: The ground station's.
        sent_us: When the last setpoint was sent, own time.
    """

    process: Popen[bytes]
    link: GroundLink
    pilot: GroundLink
    companion: Companion | None = None
    began_s: float = field(default_factory=perf_counter)
    codec: Codec = field(default_factory=lambda: Codec(255, 190))
    stopped_until_us: int = 0
    sent_us: int = 0
    _address: Address | None = None
    _pilot_address: Address | None = None

    @property
    def now_us(self) -> int:
        """The own time, which passes as the vehicle's."""
        return round((perf_counter() - self.began_s) * 1e6 * SPEED)

    def turn(self) -> None:
        """Carry what has come, and what is to be sent."""
        assert self.companion is not None, "somebody flies"
        for datagram, sender in self.link.receive_now():
            self._address = sender
            self.companion.receive(datagram, self.now_us)
        for _, sender in self.pilot.receive_now():
            self._pilot_address = sender
        frames = self.companion.poll(self.now_us)
        for frame in frames:
            if self._address is not None:
                self.link.send(frame, self._address)
                if int.from_bytes(frame[7:10], "little") == mav.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET:
                    self.sent_us = self.now_us
        if self.stopped_until_us and self.now_us > self.stopped_until_us:
            self.stopped_until_us = 0
            self.process.send_signal(signal.SIGCONT)
        self.link.wait(0.001)

    def order(self, number: int, *parameters: float) -> None:
        """Have the pilot give a command."""
        padded = [*parameters, *[0.0] * 7][:7]
        self._say("COMMAND_LONG", number, 0, *padded)

    def set(self, name: str, value: int) -> None:
        """Have the pilot set an integer parameter, bytewise."""
        self._say("PARAM_SET", name, Bits(value), mav.MAV_PARAM_TYPE_INT32)

    def _say(self, name: str, *fields: Any) -> None:
        assert self._pilot_address is not None, "PX4 calls its ground station"
        system = self.companion.peer.system if self.companion else INSTANCE + 1
        self.pilot.send(self.codec.encode(name, system, 1, *fields), self._pilot_address)

    def freeze(self, for_s: float) -> None:
        """Have PX4 stand still."""
        self.process.send_signal(signal.SIGSTOP)
        self.stopped_until_us = self.now_us + round(for_s * 1e6)


def _nothing(bench: Bench) -> None:
    del bench


def _interrupt(bench: Bench) -> None:
    assert bench.companion is not None, "it flies"
    bench.companion.stop("interrupted")


CASES: dict[str, Case] = {
    "pilot": Case(PATIENT, lambda bench: bench.order(mav.MAV_CMD_DO_SET_MODE, *RETURN)),
    "interrupted": Case(PATIENT, _interrupt),
    "late states": Case(FlightLimits(min_pace=0.01, max_gap_s=1.0), lambda bench: bench.freeze(0.3)),
    "box": Case(FlightLimits(margin_m=0.05, max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0), _nothing),
    "tilt": Case(FlightLimits(max_tilt_deg=12.0, max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0), _nothing),
    "error": Case(FlightLimits(max_error_m=0.02, max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0), _nothing),
    "estimate lost": Case(PATIENT, lambda bench: bench.set("SIM_GPS_USED", 0)),
}
TRACK = "lemniscate:lap=10"


def main(program: str, folder: Path) -> None:
    """Fly until each of them has ended a flight; write what happened."""
    bench = begin(Path(program), folder)
    ended: dict[str, dict[str, Any]] = {}
    try:
        for number, (name, case) in enumerate(CASES.items()):
            ended[name] = fly(bench, case, may_arm=number == 0)
            (folder / "endings.json").write_text(json.dumps(ended, indent=1), encoding="utf-8")
    finally:
        bench.process.send_signal(signal.SIGKILL)
        bench.process.wait()
        bench.link.close()
        bench.pilot.close()


def begin(build: Path, folder: Path) -> Bench:
    """Start PX4 in a folder of its own."""
    link, pilot = (open_ground_link(f"udpin:127.0.0.1:{port}") for port in (14540 + INSTANCE, 14550))
    command = [str(build / "bin" / "px4"), "-i", str(INSTANCE), "-d", str(build / "etc")]
    with (folder / "px4.txt").open("wb") as said:
        process = Popen(command, cwd=folder, env=os.environ | SETTINGS, stdout=said, stderr=STDOUT)
    return Bench(process, link, pilot)


def fly(bench: Bench, case: Case, *, may_arm: bool) -> dict[str, Any]:
    """Fly one flight to its end, and go on listening for what the vehicle does then; return what happened."""
    profile, vehicle = load_profile("flight"), load_vehicle("sihsim")
    settings = CompanionSettings(may_arm=may_arm, takeoff_height_m=3.0 if may_arm else None, limits=case.limits)
    track = load_track(TRACK, vehicle, profile).track
    companion = bench.companion = Companion(settings, profile, vehicle, track, perf_counter)
    give_up_us = bench.now_us + round(GIVE_UP_S * 1e6)
    flying_us = disturbed_us = limited_us = 0
    while companion.ended is None and bench.now_us < give_up_us:
        bench.turn()
        if companion.phase is Phase.CHECKING and not may_arm and companion.peer.report.mode != HOLD.custom:
            bench.order(mav.MAV_CMD_DO_SET_MODE, *HOLD.command)
        if companion.phase is Phase.FLYING and not flying_us:
            flying_us = bench.now_us
        if flying_us and not disturbed_us and bench.now_us - flying_us > FLIES_S * 1e6:
            disturbed_us = bench.now_us
            case.disturb(bench)
        if companion.limit is not None and not limited_us:
            limited_us = bench.now_us
    ended_us = bench.now_us
    stays_us = bench.now_us + 1_000_000
    while bench.now_us < stays_us:
        bench.turn()
    report = companion.peer.report
    return {
        "ended": companion.ended is not None and companion.ended.why,
        "in_order": companion.ended is not None and companion.ended.in_order,
        "limit": companion.limit.name if companion.limit else "",
        "mode": report.mode,
        "armed": report.armed,
        "sent_after_disturbed_s": (bench.sent_us - disturbed_us) * 1e-6 if disturbed_us else None,
        "limit_after_disturbed_s": (limited_us - disturbed_us) * 1e-6 if limited_us and disturbed_us else None,
        "ended_after_limit_s": (ended_us - limited_us) * 1e-6 if limited_us else None,
        "phases": companion.said,
    }


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
