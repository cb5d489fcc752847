"""What the plant's process keeps and reports of one ArduPilot after the other, by a link and a clock of the test's."""

import json
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from colibri.common.process.lifecycle import Stop
from colibri.common.process.status import Status
from colibri.common.types import Address
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.process import ardupilot_server
from colibri.plant.process.ardupilot_server import ArduPilotEnd, ArduPilotServer
from colibri.plant.process.reports import PlantLogs
from colibri.plant.vehicle.description import load_vehicle
from tests.support.ardupilot import request
from tools.harness.processes import topic_rows

SENDER = ("127.0.0.1", 50000)
VEHICLE = load_vehicle("hummingbird")


class Script:
    """A link over which requests come at given times of the wall clock; it is that clock, and the process's end."""

    def __init__(self, requests: list[tuple[float, bytes]]) -> None:
        self._requests = requests
        self.now_s = 100.0
        self.sent: list[bytes] = []
        self.kept: Address | None = None

    def __bool__(self) -> bool:
        return not self._requests

    def receive(self, timeout_s: float) -> tuple[bytes, Address] | None:
        at_s, datagram = self._requests[0]
        if at_s > self.now_s + timeout_s:
            self.now_s += timeout_s
            return None
        self.now_s = at_s
        del self._requests[0]
        return datagram, SENDER

    def receive_now(self) -> list[tuple[bytes, Address]]:
        """Return nothing: requests come one by one."""
        return []

    def send(self, datagram: bytes, _address: Address) -> None:
        self.sent.append(datagram)

    def keep_to(self, peer: Address) -> None:
        self.kept = peer

    def release(self) -> None:
        self.kept = None


def flight(began_s: float, steps: int, every_s: float) -> list[tuple[float, bytes]]:
    return [(began_s + every_s * count, request(count)) for count in range(steps)]


def test_each_ardupilot_has_a_wall_clock_and_steps_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first takes 2 s for 1 s, and is gone; a minute later the second takes half a second for one."""
    script = Script(flight(110.0, 401, 0.005) + flight(170.0, 401, 0.00125))
    monkeypatch.setattr(ardupilot_server, "perf_counter", lambda: script.now_s)
    world, rotors, logs = starting_world(Start(), VEHICLE), VEHICLE.rotors, PlantLogs(tmp_path, VEHICLE)
    end = ArduPilotEnd(Physics(VEHICLE, "rk4"), world, rotors.numbering(), rotors)
    link, stop = cast(UdpLink, script), cast(Stop, script)
    ArduPilotServer(end, link, Status("plant", as_json=True), stop, logs).serve(duration_s=100.0)
    logs.close()
    assert len(script.sent) == 2 * 401
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    gone, ended = (event for event in events if event["event"] in ("gone", "ended"))
    assert (gone["event"], gone["steps"], gone["sim_time_s"]) == ("gone", 401, 1.0025)
    assert gone["wall_time_s"] == pytest.approx(2.0)
    assert (ended["event"], ended["steps"], ended["sim_time_s"], ended["restarts"]) == ("ended", 401, 1.0025, 1)
    assert ended["wall_time_s"] == pytest.approx(0.5)
    progress = [event for event in events if event["event"] == "progress"]
    times_real = [event["sim_time_s"] / event["wall_time_s"] for event in progress]
    assert (min(times_real), max(times_real)) == (pytest.approx(0.5, rel=0.05), pytest.approx(2.0, rel=0.05))
    assert len(progress) > 15  # every 0.1 s of either
    assert [event["text"] for event in events if event["event"] == "silence"] == [
        "no request at t = 1.002 s, waiting for ArduPilot"
    ]
    for name in ("flight-1.ulg", "flight.ulg"):
        assert topic_rows(tmp_path / name)["t"] == pytest.approx(0.0025 * np.arange(1, 402))
