"""MAVProxy flies the vehicle by its own command line; what it prints is held against what an observer sees."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from math import dist, hypot
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.common.earth.home import DEFAULT_HOME
from tests.clients.support.mavproxy import MavProxy
from tools.harness.ports import bound_socket
from tools.harness.processes import SitlProcess, vehicle, wait_for

pytestmark = pytest.mark.clients

SPEED = 4.0


@contextmanager
def connected(folder: Path, *options: str) -> Iterator[tuple[MavProxy, SitlProcess]]:
    with vehicle(folder, *options, speed=SPEED) as flown, MavProxy(folder, f"udpout:127.0.0.1:{flown.port}") as proxy:
        yield proxy, flown


def at(east_m: float, north_m: float) -> str:
    place = geodetic_of((east_m, north_m, 0.0), Geodetic(*DEFAULT_HOME[:3]))
    return f"{place.latitude_deg:.7f} {place.longitude_deg:.7f}"


def waypoints(path: Path, *rows: tuple[int, int, float, str, float]) -> Path:
    """Write a file of items, each frame, command, first parameter, place, height."""
    lines = ["QGC WPL 110"]
    for seq, (frame, command, p1, place, height_m) in enumerate(rows):
        lines.append(f"{seq} 0 {frame} {command} {p1} 0 0 0 {place} {height_m} 1".replace(" ", "\t"))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_flight(tmp_path: Path) -> None:
    with connected(tmp_path) as (proxy, flown):
        seen = flown.seen
        proxy.type("version", r"> ")
        proxy.type("disarm", r"Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")
        proxy.type("status AUTOPILOT_VERSION", r"AUTOPILOT_VERSION \{capabilities : \d+, flight_sw_version : \d+")
        proxy.type("arm throttle", r"Got COMMAND_ACK: COMPONENT_ARM_DISARM: ACCEPTED")
        proxy.expect("ARMED")
        proxy.type("takeoff 5", r"Got COMMAND_ACK: NAV_TAKEOFF: ACCEPTED")
        proxy.expect("TAKEOFF> ")
        proxy.expect("LOITER> ")
        seen.wait(lambda s: s.mode is Mode.HOLD and abs(s.height_m - 5.0) < 0.05, "the height")

        proxy.type("disarm", r"COMPONENT_ARM_DISARM: DENIED")
        proxy.expect("AP: Disarming denied: not landed")
        assert seen.now.armed

        proxy.type(f"guided {at(6.0, 8.0)} 7", r"Got COMMAND_ACK: DO_REPOSITION: ACCEPTED")
        seen.wait(lambda s: dist(s.position_enu_m, (6.0, 8.0, 7.0)) < 0.1, "the place")
        proxy.type("setspeed 2", r"Got COMMAND_ACK: DO_CHANGE_SPEED: ACCEPTED")

        # `mode` and `rtl` fail inside MAVProxy: it hands the triple that pymavlink has for PX4's modes to a number.
        proxy.type("rtl", r"required argument is not a float")
        proxy.type("mode LAND", r"required argument is not a float")
        proxy.type("mode", r"Available modes: .*LOITER")
        assert seen.now.mode is Mode.HOLD
        proxy.type("long DO_SET_MODE 1 4 3", r"Got COMMAND_ACK: DO_SET_MODE: ACCEPTED")
        proxy.type("long NAV_LOITER_UNLIM", r"Got COMMAND_ACK: NAV_LOITER_UNLIM: ACCEPTED")
        proxy.type("long NAV_RETURN_TO_LAUNCH", r"Got COMMAND_ACK: NAV_RETURN_TO_LAUNCH: ACCEPTED")
        proxy.expect("RTL> ")
        proxy.expect("AP: Disarmed by landing")
        landed = seen.wait(lambda s: not s.armed, "the end of the flight")
        assert hypot(*landed.position_enu_m[:2]) < 0.3
        assert seen.modes()[-3:] == [Mode.TAKEOFF, Mode.HOLD, Mode.RETURN]

        proxy.type("log list", r"Log 0 .*size \d+")
        (log,) = (flown.state / "0" / "logs").glob("*.ulg")
        proxy.type(f"log download 0 {tmp_path / 'log.bin'}", r"Finished downloading .*log\.bin")
        assert (tmp_path / "log.bin").read_bytes() == log.read_bytes()


def test_parameters(tmp_path: Path) -> None:
    with connected(tmp_path) as (proxy, flown):
        count = int(proxy.type("param fetch", r"Received (\d+) parameters")[1])
        shown = proxy.type("param show *", rf"(?:\w+ +\S+\n){{{count}}}")
        assert re.search(r"^MIS_TAKEOFF_ALT +2\.5$", shown[0], re.MULTILINE)
        proxy.type("param set MIS_TAKEOFF_ALT 4.25", r"> ")
        proxy.type("param set SYS_FAILURE_EN 1", r"> ")
        proxy.type("param fetch", r"Received \d+ parameters")
        proxy.type("param show MIS_TAKEOFF_ALT", r"MIS_TAKEOFF_ALT +4\.25")
        proxy.type("param show SYS_FAILURE_EN", r"SYS_FAILURE_EN +1")
        assert flown.seen.parameter("MIS_TAKEOFF_ALT") == 4.25
        proxy.type("param set NO_SUCH_THING 1", "Unable to find parameter 'NO_SUCH_THING'")


def test_a_mission_a_fence_and_rally_points(tmp_path: Path) -> None:
    with connected(tmp_path) as (proxy, flown):
        seen = flown.seen
        mission = waypoints(
            tmp_path / "mission.txt",
            (3, 22, 0.0, at(0.0, 0.0), 5.0),
            (3, 16, 0.0, at(0.0, 9.0), 5.0),
            (3, 20, 0.0, "0 0", 0.0),
        )
        proxy.type(f"wp load {mission}", "Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
        assert seen.plan_length(0) == 3
        proxy.type(f"wp save {tmp_path / 'again.txt'}", "Saved 3 waypoints")
        again = [pytest.approx(row, abs=1e-6) for row in items(tmp_path / "again.txt")]  # it writes six digits
        assert items(mission) == again

        fence = waypoints(
            tmp_path / "fence.txt",
            *((0, 5001, 4.0, at(x, y), 0.0) for x, y in ((-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0))),
        )
        proxy.type(f"fence load {fence}", "Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
        assert seen.plan_length(1) == 4
        proxy.type("fence list", "Saved 4 fence items")
        rally = waypoints(tmp_path / "rally.txt", (3, 5100, 0.0, at(10.0, 0.0), 20.0))
        proxy.type(f"rally load {rally}", "Got MISSION_ACK: TYPE_RALLY: ACCEPTED")
        assert seen.plan_length(2) == 1
        proxy.type("rally list", "Saved 1 rally items")

        # Outside the fence it does not go; the mission within it is flown.
        proxy.type("arm throttle", r"COMPONENT_ARM_DISARM: ACCEPTED")
        proxy.type("long MISSION_START", r"Got COMMAND_ACK: MISSION_START: ACCEPTED")
        proxy.expect("MISSION> ")
        seen.wait(lambda s: abs(s.height_m - 5.0) < 0.2, "the height")
        proxy.type(f"guided {at(60.0, 0.0)} 5", r"Got COMMAND_ACK: DO_REPOSITION: DENIED")
        proxy.expect("RTL> ")
        seen.wait(lambda s: not s.armed, "the end of the flight")
        assert min(dist(sight.position_enu_m, (0.0, 9.0, 5.0)) for sight in seen.sights) < 1.0

        proxy.type("fence clear", "Got MISSION_ACK: TYPE_FENCE: ACCEPTED")
        proxy.type("rally clear", "Got MISSION_ACK: TYPE_RALLY: ACCEPTED")
        proxy.type("wp clear", "Got MISSION_ACK: TYPE_MISSION: ACCEPTED")
        assert [seen.plan_length(kind) for kind in range(3)] == [0, 0, 0]


def items(path: Path) -> list[list[float]]:
    rows = path.read_text(encoding="utf-8").splitlines()[1:]
    return [[float(value) for column, value in enumerate(row.split()) if column != 1] for row in rows]


def test_files(tmp_path: Path) -> None:
    with connected(tmp_path) as (proxy, _):
        size = proxy.type("ftp list", r"parameter\.json\s+(\d+)")[1]
        proxy.type("ftp get /parameter.json", rf"Wrote {size} bytes")
        described = json.loads((tmp_path / "parameter.json").read_text(encoding="utf-8"))
        assert "MIS_TAKEOFF_ALT" in {parameter["name"] for parameter in described["parameters"]}


def test_signing_is_set_up_and_removed(tmp_path: Path) -> None:
    waiting, called = bound_socket()
    waiting.close()  # for MAVProxy, as only who is called may set up a key
    with (
        vehicle(tmp_path, links=(called,), speed=SPEED) as flown,
        MavProxy(tmp_path, called.replace("udpout", "udpin")) as proxy,
    ):
        key = flown.state / "0" / "signing.key"
        proxy.type("signing setup open-sesame", "Setup signing key")
        proxy.type("long DO_CHANGE_SPEED 1 3 -1", r"Got COMMAND_ACK: DO_CHANGE_SPEED: ACCEPTED")
        proxy.type("arm throttle", r"COMPONENT_ARM_DISARM: ACCEPTED")
        wait_for(key.exists, "the key")
        assert key.read_bytes() == sha256(b"open-sesame").digest()
        proxy.type("signing remove", "Removed signing")
        proxy.type("disarm", r"COMPONENT_ARM_DISARM: ACCEPTED")


def test_as_generic_it_is_shown_by_number(tmp_path: Path) -> None:
    """MAVProxy then sends ArduPilot's number for a mode, which means nothing here: refused, and nothing changes."""
    with connected(tmp_path, "--identity", "generic") as (proxy, flown):
        proxy.type("arm throttle", r"COMPONENT_ARM_DISARM: ACCEPTED")
        proxy.type("takeoff 3", r"Got COMMAND_ACK: NAV_TAKEOFF: ACCEPTED")
        flown.seen.wait(lambda s: s.flying and s.mode is Mode.HOLD, "the height")
        proxy.type("mode RTL", r"DO_SET_MODE: (UNSUPPORTED|DENIED)")
        assert flown.seen.now.mode is Mode.HOLD
