"""The work of a frame is limited, whatever ground stations request; counted, not timed."""

import subprocess
import sys
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from colibri.autopilot.commander.fence import CHECKED_AT_ONCE
from colibri.autopilot.control.rotor_loss.reduced_attitude import ReducedAttitude
from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.step import Received
from colibri.autopilot.guidance.mission.geofence import Geofence
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.parameters import retuning
from colibri.mavlink.node.channel import Channel
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.streaming.service import MAX_STREAMED
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.ground_station import Station
from tools.frames import REQUESTS, in_the_air, sets
from tools.fuzz.vehicle import COMPONENT, SYSTEM, BareFlight

ALL_ARE_USED = """
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
import numpy as np
from colibri.autopilot.control.qp import Qp, QpSolver
from colibri.mavlink.files.folder import Folder
from tools.frames import fly_frame
from tools.frames import REQUESTS
from tools.fuzz.vehicle import BareFlight

with TemporaryDirectory() as folder:
    flight = BareFlight(files=Folder(Path(folder)))
    solvers = [QpSolver(name, 1e-9) for name in ("daqp", "clarabel")]
    before = set(sys.modules)
    for solver in solvers:  # an infeasible QP
        solver.solve(Qp(np.eye(1), np.zeros(1), np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0])))
    for name in REQUESTS:
        if "32 stations" not in name and name != "each parameter alone":
            for messages in REQUESTS[name](flight):
                fly_frame(flight, messages)
print(*set(sys.modules) - before)
"""


class Counted:
    """Counts work for ground stations: of the frame, of the worst frame, of all frames."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = self.most = self.total = 0
        self._monkeypatch = monkeypatch
        serve = Autopilot.serve

        def counting(autopilot: Autopilot[Any], inbox: Iterable[Received] = ()) -> list[Outgoing]:
            self.now = 0
            outbox = serve(autopilot, inbox)
            self.most, self.total = max(self.most, self.now), self.total + self.now
            return outbox

        monkeypatch.setattr(Autopilot, "serve", counting)

    def at(self, owner: Any, name: str, count: Callable[..., int] = lambda *_: 1) -> None:
        method = getattr(owner, name)

        def counted(*args: Any, **kwargs: Any) -> Any:
            self.now += count(*args)
            return method(*args, **kwargs)

        self._monkeypatch.setattr(owner, name, counted)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    return Counted(monkeypatch)


def fly(name: str, frames: int = 60) -> BareFlight:
    flight = BareFlight()
    in_the_air(flight)
    for messages in REQUESTS[name](flight):
        flight.client.send_raw(b"".join(messages)[:4096])
        flight.step()
    for _ in range(frames):
        flight.step()
    return flight


@pytest.mark.parametrize("name", ["120 parameters of the law", "120 parameters of the vehicle"])
def test_a_frame_builds_one_control_law(name: str, counted: Counted) -> None:
    counted.at(retuning, "check_controller")
    flight = fly(name)
    flight.wait_until(lambda: not flight.copter.parameters.proposed, within=2.0, what="the end of all trials")
    assert counted.most == 1
    assert counted.total < 10


@pytest.mark.parametrize(
    ("name", "built"), [("120 parameters of the vehicle", ReducedAttitude), ("80 changes of mode", Planner)]
)
def test_a_frame_builds_one_thing(name: str, built: type, counted: Counted) -> None:
    counted.at(built, "__init__")
    fly(name)
    assert counted.most == 1


@pytest.mark.parametrize("name", ["mission of 900 items", "fence of 330 triangles", "80 orbits"])
def test_a_frame_checks_few_places(name: str, counted: Counted) -> None:
    counted.at(Geofence, "margins_m", lambda fence, places: len(places) * fence.size)
    fly(name)
    assert counted.total > CHECKED_AT_ONCE
    assert counted.most < 7 * CHECKED_AT_ONCE  # one more request than the budget allows


def test_a_frame_streams_few_messages(counted: Counted) -> None:
    flight = fly("32 stations at 250 Hz")
    counted.at(Channel, "say")
    for _ in range(20):
        flight.step()
    assert MAX_STREAMED <= counted.most < 4 * MAX_STREAMED  # some streams are of several messages


@pytest.mark.parametrize("flood", ["80 orbits", "15 listings of 1000 files"])
def test_a_flood_does_not_lock_out_other_stations(flood: str) -> None:
    flight = BareFlight()
    in_the_air(flight)
    other = flight.add(Station, 254)
    datagram = max((b"".join(messages)[:4096] for messages in REQUESTS[flood](flight)), key=len)
    parameter = next(each for each in flight.copter.parameters if each.name == "VEH_MASS")
    for frame in range(150):
        flight.client.send_raw(datagram)
        if frame == 60:
            other.send_raw(sets(parameter, 0.05))
            other.send("COMMAND_LONG", SYSTEM, COMPONENT, mav.MAV_CMD_REQUEST_MESSAGE, 0, 148, *(0.0,) * 6)
        flight.step()
        assert bool(other.acks) == (frame > 70) or 60 <= frame <= 70
    assert flight.copter.parameters["VEH_MASS"] == pytest.approx(1.05 * parameter.default)


@pytest.mark.long
def test_nothing_is_imported_in_flight() -> None:
    """Imports take 0.2 s where SciPy is among them."""
    assert subprocess.check_output([sys.executable, "-c", ALL_ARE_USED], text=True).split() == []
