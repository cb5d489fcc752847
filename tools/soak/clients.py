"""`make soak-clients`: two ground stations and a companion on one vehicle."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import chain, cycle
from math import cos, dist, sin
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any, NamedTuple

import psutil

from colibri import plant
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.commands import padded
from colibri.mavlink.client.setpoints import position_target
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Message, mav
from colibri.mavlink.wire.ned import ned_from_enu
from tools.harness.ports import OnPort
from tools.harness.processes import vehicle

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
OFFBOARD = (mav.MAV_CMD_DO_SET_MODE, 1, 6, 0)
ARM = (mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)

VEHICLE = (1, AUTOPILOT_COMPONENT)
_ASKED = ("AUTOPILOT_VERSION", "HOME_POSITION", "ODOMETRY", "ESTIMATOR_STATUS", "AVAILABLE_MODES", "GPS_GLOBAL_ORIGIN")
_STREAMED_US = {"ATTITUDE_QUATERNION": 4_000, "LOCAL_POSITION_NED": 8_000, "HIGHRES_IMU": 8_000, "ATTITUDE": 20_000}

_SETPOINT_EVERY_S = 0.05
_RADIUS_M, _RATE_RAD_S, _HEIGHT_M = 2.0, 0.5, 3.0


class Ack(NamedTuple):
    command: int
    result: int
    target: tuple[int, int]


class HarnessStation:
    """A ground station; `max_gap_s` is the longest time between heartbeats."""

    def __init__(
        self,
        system_id: int,
        component_id: int = mav.MAV_COMP_ID_MISSIONPLANNER,
        *,
        every: int = 25,
        orders: Sequence[tuple[float, ...]] = (),
    ) -> None:
        """Send with every `every`-th datagram first `orders` (MAV_CMD, parameters), then all kinds."""
        self.identity = (system_id, component_id)
        self.sent: Counter[int] = Counter()
        self.counts: Counter[str] = Counter()
        self.acks: Counter[Ack] = Counter()
        self.max_gap_s = 0.0
        self.time_s = 0.0
        self.position_ned_m = (0.0, 0.0, 0.0)
        self._every = every
        first = [partial(self._command, int(command), *values) for command, *values in orders]
        self._wishes: Iterator[Callable[[], None]] = chain(first, cycle(self._wish()))
        self._client = Client(*self.identity, only=VEHICLE[0])
        self._datagrams = 0
        self._heartbeat_s: float | None = None
        self._outbox: list[bytes] = []

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        self._datagrams += 1
        now_us = round(now_s * 1e6)
        for message in self._client.receive(datagram, now_us):
            self._take(message, now_s)
        self._told()
        if self._datagrams % self._every == 0:
            next(self._wishes)()
        outbox, self._outbox = self._outbox, []
        return outbox + self._client.poll(now_us)

    def _take(self, message: Message, now_s: float) -> None:
        self.counts[message.name] += 1
        fields = message.fields
        if message.name == "HEARTBEAT":
            if self._heartbeat_s is not None:
                self.max_gap_s = max(self.max_gap_s, now_s - self._heartbeat_s)
            self._heartbeat_s = now_s
        elif message.name == "LOCAL_POSITION_NED":
            self.time_s = fields.time_boot_ms * 1e-3
            self.position_ned_m = (fields.x, fields.y, fields.z)
        elif message.name == "COMMAND_ACK":
            self.acks[Ack(fields.command, fields.result, (fields.target_system, fields.target_component))] += 1

    def _told(self) -> None:
        """Act on any datagram."""

    def _wish(self) -> Iterator[Callable[[], None]]:
        for name, interval_us in _STREAMED_US.items():
            yield partial(self._command, mav.MAV_CMD_SET_MESSAGE_INTERVAL, _number(name), interval_us)
        for name in _ASKED:
            yield partial(self._command, mav.MAV_CMD_REQUEST_MESSAGE, _number(name))
        yield partial(self._tell, "PARAM_REQUEST_LIST")
        yield partial(self._tell, "PARAM_REQUEST_READ", "TRACK", -1)
        yield partial(self._tell, "MISSION_REQUEST_LIST", mav.MAV_MISSION_TYPE_MISSION)
        yield partial(self._send, "PING", 0, 7, 0, 0)
        yield partial(self._send, "TIMESYNC", 0, 7)

    def _command(self, command: int, *parameters: float) -> None:
        self.sent[command] += 1
        self._tell("COMMAND_LONG", command, 0, *padded(parameters, 7))

    def _tell(self, name: str, *fields: Any) -> None:
        self._send(name, *VEHICLE, *fields)

    def _send(self, name: str, *fields: Any) -> None:
        self._outbox.append(self._client.encode(name, *fields))


class CirclingCompanion(HarnessStation):
    """A companion that flies a circle; `off_m` is its largest error."""

    def __init__(self, system_id: int) -> None:
        super().__init__(system_id, mav.MAV_COMP_ID_ONBOARD_COMPUTER, orders=[OFFBOARD, ARM])
        self.off_m = 0.0
        self._setpoint_s = 0.0
        self._caught_up = False

    def _told(self) -> None:
        if self.time_s < self._setpoint_s + _SETPOINT_EVERY_S:
            return
        self._setpoint_s = self.time_s
        angle = _RATE_RAD_S * self.time_s
        east, north, _ = place = (_RADIUS_M * sin(angle), _RADIUS_M * cos(angle), _HEIGHT_M)
        away_m = dist(ned_from_enu(self.position_ned_m), place)
        self._caught_up = self._caught_up or away_m < 0.15
        if self._caught_up:
            self.off_m = max(self.off_m, away_m)
        velocity = (_RATE_RAD_S * north, -_RATE_RAD_S * east, 0.0)
        name, fields = position_target(VEHICLE, place, velocity, time_us=round(self.time_s * 1e6))
        self._send(name, *fields)


def _number(name: str) -> int:
    number: int = getattr(mav, f"MAVLINK_MSG_ID_{name}")
    return number


MAX_GAP_S = 1.5
MAX_GROWTH_BYTES = 2_000_000
MAX_ERROR_M = 0.5
WARM_UP_S = 60.0
LOOK_EVERY_S = 5.0

_VEHICLE = Path(plant.__file__).parent / "vehicle" / "models" / "hummingbird.toml"


class Look(NamedTuple):
    wall_s: float
    sim_s: float
    resident_bytes: dict[str, int]
    cpu_s: dict[str, float]


def crew() -> tuple[HarnessStation, HarnessStation, CirclingCompanion]:
    return HarnessStation(255), HarnessStation(254), CirclingCompanion(245)


def faults(crew: Iterable[HarnessStation]) -> list[str]:
    found = []
    for client in crew:
        name = f"{client.identity[0]}/{client.identity[1]}"
        if client.max_gap_s > MAX_GAP_S:
            found.append(f"{name}: {client.max_gap_s:.2f} s without a heartbeat")
        found += [f"{name}: got {ack} of another" for ack in client.acks if ack.target != client.identity]
        acknowledged = sum(client.acks.values())
        if not sum(client.sent.values()) - 2 <= acknowledged <= sum(client.sent.values()):
            found.append(f"{name}: {acknowledged} of {sum(client.sent.values())} commands acknowledged")
        if isinstance(client, CirclingCompanion) and not 0.0 < client.off_m < MAX_ERROR_M:
            found.append(f"{name}: {client.off_m:.2f} m off its circle")
    return found


def soak(duration_s: float) -> tuple[list[str], list[str]]:
    """Return what was measured, and what is wrong."""
    clients = crew()
    with TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        links = tuple(stack.enter_context(OnPort(client)).url for client in clients)
        tireless = folder / "tireless.toml"
        tireless.write_text(_VEHICLE.read_text(encoding="utf-8").partition("[battery]")[0], encoding="utf-8")
        flown = stack.enter_context(vehicle(folder, "--vehicle", str(tireless), links=links))
        processes = {child.cmdline()[3]: child for child in psutil.Process(flown.process.pid).children()}

        def look() -> Look:
            resident = {name: process.memory_info().rss for name, process in processes.items()}
            cpu_s = {name: sum(process.cpu_times()[:2]) for name, process in processes.items()}
            return Look(monotonic(), clients[0].time_s, resident, cpu_s)

        began_s = monotonic()
        sleep(min(WARM_UP_S, 0.5 * duration_s))
        warm = last = look()
        while last is warm or (last.wall_s < began_s + duration_s and flown.process.poll() is None):
            sleep(LOOK_EVERY_S)
            last = look()
        ended = flown.process.poll()
    lasted_s = last.wall_s - warm.wall_s
    said = [f"{(last.sim_s - warm.sim_s) / lasted_s:.3f} times real time for {lasted_s:.0f} s"]
    wrong = faults(clients) + ([] if ended is None else [f"the vehicle ended with exit code {ended}"])
    for process, resident in last.resident_bytes.items():
        growth, cpu_s = resident - warm.resident_bytes[process], last.cpu_s[process] - warm.cpu_s[process]
        said.append(f"{process}: {resident} bytes, grown by {growth}, {100 * cpu_s / lasted_s:.0f} % of a core")
        wrong += [f"{process} grew by {growth} bytes"] * (growth > MAX_GROWTH_BYTES)
    for client in clients:
        counts = f"{sum(client.acks.values())} of {sum(client.sent.values())} commands acknowledged"
        heard = f"{sum(client.counts.values())} messages, longest gap {client.max_gap_s:.2f} s"
        off = f", {client.off_m:.2f} m off its circle" if isinstance(client, CirclingCompanion) else ""
        said.append(f"{client.identity[0]}/{client.identity[1]}: {counts}, {heard}{off}")
    return said, wrong


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tools.soak.clients", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    args = parser.parse_args()
    said, wrong = soak(60.0 * args.minutes)
    print(*said, *(f"FAILED: {fault}" for fault in wrong), sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
