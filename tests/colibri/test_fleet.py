import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import time

import psutil
import pytest
from rich.console import Console

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.earth.geodesy import enu_of
from colibri.common.earth.home import DEFAULT_HOME
from colibri.flights.fleet import Member, StatusLines, place_of, start_again, status_table
from colibri.flights.fleet_spec import FleetSpec
from colibri.flights.launcher import Child, end_children
from colibri.flights.replay import replay_flight
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.tlog import decode
from colibri.plant.spec import PlantSpec
from tests.clients.support.ground_station import GroundStation
from tools.harness.processes import WAITING, SitlProcess, vehicle, wait_for

SHUT_DOWN, ACCEPTED = mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, mav.MAV_RESULT_ACCEPTED


def test_each_instance_has_its_own_port_for_sdks() -> None:
    asked = FleetSpec()
    assert asked.links(0) == ["udpout:127.0.0.1:14550", "udpout:127.0.0.1:14540"]
    assert asked.links(2) == ["udpout:127.0.0.1:14550", "udpout:127.0.0.1:14542"]


def test_who_only_starts_vehicles_does_not_load_what_flies() -> None:
    program = "import sys, colibri.flights.fleet; print({'numba', 'scipy', 'qpsolvers'} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "set()\n"


@contextmanager
def standing(folder: Path, *links: str) -> Iterator[tuple[SitlProcess, list[psutil.Process]]]:
    with vehicle(folder, links=links) as flown:
        children = psutil.Process(flown.process.pid).children(recursive=True)
        assert len(children) == 2
        yield flown, children


def assert_gone(processes: list[psutil.Process]) -> None:
    assert not [process for process in processes if process.is_running()]


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_it_ends_when_told_to(tmp_path: Path, number: signal.Signals) -> None:
    with standing(tmp_path) as (flown, children):
        flown.process.send_signal(number)
        assert flown.process.wait(10.0) == 0
        assert_gone(children)
        assert "error" not in flown.said
        assert "Traceback" not in flown.said


def test_ctrl_c_in_a_terminal_while_it_starts(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "colibri", "sitl", "--plant-port", "0", "--gcs", "udpin:127.0.0.1:0"]
    command += ["--state", str(tmp_path / "state")]
    errors = tmp_path / "errors"
    with errors.open("wb") as said:
        process = subprocess.Popen(command, stderr=said, stdin=subprocess.DEVNULL, start_new_session=True)
    started = psutil.Process(process.pid)
    wait_for(started.children, "its first process")
    children = started.children()
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(10.0) == 0
    assert_gone(children)
    assert errors.read_text(encoding="utf-8") == ""


@pytest.mark.parametrize("name", ["autopilot", pytest.param("plant", marks=pytest.mark.long)])
def test_a_process_that_dies_is_started_again(tmp_path: Path, name: str) -> None:
    with standing(tmp_path, WAITING) as (flown, children):
        (victim,) = (child for child in children if child.name() == name)
        victim.send_signal(signal.SIGKILL)
        wait_for(lambda: flown.said.count("the plant sends frames") == 2, "the next one")
        died, *after = flown.said.partition("started again")[0::2]
        assert died.endswith(f"  1 {name} was killed by SIGKILL; ")
        assert "error" not in after[0]
        assert len(set(flown.ports)) == 1
        assert flown.end() == 0


def dead(name: str, code: int) -> Child:
    child = Child(AutopilotSpec() if name == "autopilot" else PlantSpec(link="udpin:127.0.0.1:0"))
    child.kill()
    child.code = lambda: code  # type: ignore[method-assign]
    return child


def test_what_dies_again_and_again_ends_it_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    member, args = Member(0, 0.0, []), FleetSpec(out=tmp_path)
    monkeypatch.setattr("colibri.flights.fleet._start_autopilot", lambda *_: None)
    lines = StatusLines(quiet=True)
    for _ in range(3):
        member.children = [dead("autopilot", -9)]
        start_again(member, args, lines)
        assert member.children == []
    member.children = [dead("autopilot", 1)]
    with pytest.raises(SystemExit) as ended:
        start_again(member, args, lines)
    end_children(member.children)
    assert ended.value.code == 1
    *again, last = capfd.readouterr().err.splitlines()
    assert again == ["  1 autopilot was killed by SIGKILL; started again"] * 3
    assert last == "colibri: error: the autopilot of instance 0 ended with exit code 1, the 4th death within 60 s"


def test_what_cannot_begin_is_not_started_again() -> None:
    member = Member(0, 0.0, [], [dead("autopilot", 2)])
    with pytest.raises(SystemExit) as ended:
        start_again(member, FleetSpec(), StatusLines(quiet=True))
    end_children(member.children)
    assert ended.value.code == 2


def test_a_fleet_stands_in_a_row() -> None:
    args = FleetSpec()
    assert place_of(Member(4, 0.0, []), args) == DEFAULT_HOME
    place = place_of(Member(5, 6.0, []), args)
    assert enu_of(place.origin, DEFAULT_HOME.origin) == pytest.approx((6.0, 0.0, 0.0), abs=1e-3)
    assert place[2:] == DEFAULT_HOME[2:]


def test_a_ground_station_shuts_it_down(tmp_path: Path) -> None:
    with GroundStation() as station, standing(tmp_path, station.url) as (flown, children):
        station.wait("HEARTBEAT")
        assert station.command(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, -5.0) != ACCEPTED
        wait_for(
            lambda: "  1 autopilot: warning: take-off refused: -5 m above the ground" in flown.said, "a STATUSTEXT"
        )
        assert station.command(SHUT_DOWN, 2.0, 0, 0, 0, 0, 0, 0) == ACCEPTED
        assert flown.process.wait(10.0) == 0
        assert_gone(children)
        assert "  1 autopilot: shut down by a ground station" in flown.said.splitlines()


def test_its_time_is_over_and_its_log_has_the_date(tmp_path: Path) -> None:
    began_us = time() * 1e6
    with vehicle(tmp_path, "--duration", "0.5", "--out", str(tmp_path / "out")) as flown:
        assert flown.process.wait(30.0) == 0
    tlog = tmp_path / "out" / "0" / "flight.tlog"
    times_us = [time_us for time_us, _ in decode(tlog.read_bytes())]
    assert began_us < times_us[0] < times_us[-1] < time() * 1e6
    assert replay_flight(tlog.parent) == (125, 496_000, None)


FACT = {
    "mode": "stabilized",
    "armed": False,
    "position_enu_m": (-0.04, -123.45, 78.9),
    "speed_m_s": 12.34,
    "sim_time_s": 12345.6,
    "times_real_time": 1.004,
    "solve_time_us": 123.4,
    "links": [
        {"url": "udpout:127.0.0.1:14550", "heard": ["255/190"], "received_hz": 2.4, "sent_hz": 61.0, "lost": 0},
        {"url": "udpout:127.0.0.1:14540", "heard": [], "received_hz": 0.0, "sent_hz": 0.0, "lost": 0},
    ],
}


def drawn(*instances: int, width: int = 80) -> list[str]:
    console = Console(width=width, force_terminal=False, color_system=None)
    with console.capture() as capture:
        console.print(status_table({instance: FACT for instance in instances}, width))
    return [line.rstrip() for line in capture.get().splitlines()]


@pytest.mark.parametrize(("terminal", "said"), [("1", "starting 3 vehicles\n"), ("", "")])
def test_a_terminal_is_told_at_once_that_it_starts(
    terminal: str, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", terminal)
    monkeypatch.setenv("NO_COLOR", "1")
    StatusLines(quiet=False).begin(3)
    StatusLines(quiet=True).begin(3)
    assert capsys.readouterr().err == said


def test_the_status_line_fits_a_terminal() -> None:
    assert drawn(0) == [
        " id    time   real mode       rotors     east  north      up    speed solver",
        "  1 12346 s x 1.00 stabilized disarmed    0.0 -123.5  78.9 m 12.3 m/s 123 µs",
        "  1  udpout:127.0.0.1:14550  from 255/190  2/s in  61/s out",
        "  1  udpout:127.0.0.1:14540  no client     0/s in   0/s out",
    ]


def test_a_narrow_terminal_shows_what_matters_most() -> None:
    assert drawn(0, width=40) == [
        " id    time mode       rotors        up",
        "  1 12346 s stabilized disarmed  78.9 m",
        "  1  127.0.0.1:14550  from 255/190",
        "  1  127.0.0.1:14540  no client",
    ]
    assert drawn(0, width=20)[0].split() == ["id", "mode"]


def test_the_status_lines_of_a_fleet_leave_out_who_is_not_heard() -> None:
    assert [line[:30] for line in drawn(1, 0)] == [
        " id    time   real mode       ",
        "  1 12346 s x 1.00 stabilized ",
        "  2 12346 s x 1.00 stabilized ",
        "  1  udpout:127.0.0.1:14550  f",
        "  2  udpout:127.0.0.1:14550  f",
    ]
