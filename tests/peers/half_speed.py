"""Real PX4 and a companion in this process, both at half of real time, which a busy computer still keeps to.

All times are the vehicle's. In a network namespace with loopback alone: PX4 binds to all addresses.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import STDOUT, Popen
from time import perf_counter

from colibri.common.types import Address
from colibri.companion.guide import Companion
from colibri.companion.supervision.rules import FlightLimits
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.commands import Command
from colibri.mavlink.client.parameters import SetParameter
from colibri.mavlink.links.link import GroundLink
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import mav
from tests.peers.on_the_plant import plant, px4_command, px4_settings

SPEED = 0.5
WITHOUT_LOGGER = {"PX4_PARAM_SDLOG_BACKEND": "0"}  # it holds PX4 up where the disk is slow
PX4_SETTINGS = {
    "PX4_SYS_AUTOSTART": "10040",
    "PX4_SIM_MODEL": "sihsim_quadx",
    "PX4_PARAM_COM_RC_IN_MODE": "4",
    "PX4_PARAM_COM_OF_LOSS_T": "0.3",
    "PX4_PARAM_NAV_DLL_ACT": "0",
    "PX4_PARAM_COM_RCL_EXCEPT": "7",
    "PX4_PARAM_CBRK_SUPPLY_CHK": "894281",
} | WITHOUT_LOGGER
OWN_PHYSICS = PX4_SETTINGS | {
    "PX4_SIM_SPEED_FACTOR": str(SPEED),
    "PX4_PARAM_COM_LOW_BAT_ACT": "0",
    "PX4_PARAM_SIM_BAT_MIN_PCT": "90",
    "PX4_PARAM_EKF2_NOAID_TOUT": "1000000",
}
"""An estimate without aid is lost after a second, not five."""
PATIENT = FlightLimits(max_state_age_s=0.6, min_pace=0.01, max_gap_s=1.0)
"""Where it is not the lateness that counts: a busy computer is late now and then."""


@dataclass
class Bench:
    process: Popen[bytes]
    link: GroundLink
    pilot: GroundLink
    companion: Companion | None = None
    began_s: float = field(default_factory=perf_counter)
    client: Client = field(default_factory=lambda: Client(255, 190, heartbeat_every_us=None))
    stopped_until_us: int = 0
    sent_us: int = 0
    _address: Address | None = None
    _pilot_address: Address | None = None

    @property
    def now_us(self) -> int:
        """The own time, which passes as the vehicle's."""
        return round((perf_counter() - self.began_s) * 1e6 * SPEED)

    def turn(self) -> None:
        assert self.companion is not None, "somebody flies"
        for datagram, sender in self.link.receive_now():
            self._address = sender
            self.companion.receive(datagram, self.now_us)
        for datagram, sender in self.pilot.receive_now():
            self._pilot_address = sender
            self.client.receive(datagram, self.now_us)
        for frame in self.client.poll(self.now_us) if self._pilot_address is not None else ():
            self.pilot.send(frame, self._pilot_address)
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
        self.client.begin(Command(self._target, number, *parameters))

    def set(self, name: str, value: int) -> None:
        """Have the pilot set an integer parameter, bytewise."""
        self.client.begin(SetParameter(self._target, name, value, kind=mav.MAV_PARAM_TYPE_INT32))

    @property
    def _target(self) -> tuple[int, int]:
        assert self.companion is not None, "somebody flies"
        return self.companion.peer.target

    def freeze(self, for_s: float) -> None:
        self.process.send_signal(signal.SIGSTOP)
        self.stopped_until_us = self.now_us + round(for_s * 1e6)


@contextmanager
def own_physics(build: Path, folder: Path) -> Iterator[Bench]:
    with _started([str(build / "bin" / "px4"), "-d", str(build / "etc")], folder, OWN_PHYSICS) as bench:
        yield bench


@contextmanager
def on_the_plant(build: Path, folder: Path, vehicle: str) -> Iterator[Bench]:
    with plant("px4", folder, vehicle, SPEED) as parameters:
        settings = px4_settings(parameters, SPEED) | WITHOUT_LOGGER
        with _started(px4_command(build), folder, settings) as bench:
            yield bench


@contextmanager
def _started(command: list[str], folder: Path, settings: dict[str, str]) -> Iterator[Bench]:
    link, pilot = (open_ground_link(f"udpin:127.0.0.1:{port}") for port in (14540, 14550))
    with (folder / "px4.txt").open("wb") as said:
        process = Popen(command, cwd=folder, env=os.environ | settings, stdout=said, stderr=STDOUT)
    try:
        yield Bench(process, link, pilot)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        link.close()
        pilot.close()
