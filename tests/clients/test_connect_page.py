"""Run the snippets of docs/ground-stations.md on other ports."""

import re
import socket
import subprocess
import sys
from math import hypot
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.flights.fleet_spec import GROUND_PORT, SDK_PORT
from tests.clients.support.geometry import closest_m, place
from tests.clients.support.mavproxy import MavProxy
from tools.harness.processes import vehicle

PAGE = Path(__file__).parents[2] / "docs" / "ground-stations.md"
GIVE_UP_AFTER_S = 120.0
SPEED = 4.0


def snippets(beginning: str) -> list[str]:
    _, _, behind = f"\n{PAGE.read_text(encoding='utf-8')}".partition(f"\n{beginning}")
    assert behind, f"the page has no line that begins with {beginning}"
    behind = behind.partition("\n## ")[0]
    return re.findall(r"```\w*\n(.*?)```", behind, re.DOTALL)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


def run(code: str, default_port: int, port: int, folder: Path) -> None:
    assert code.count(str(default_port)) == 1
    program = folder / "snippet.py"
    program.write_text(code.replace(str(default_port), str(port)), encoding="utf-8")
    command = [sys.executable, str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=GIVE_UP_AFTER_S)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_command_is_all_that_qgroundcontrol_needs() -> None:
    assert snippets("# Connect")[0] == ".venv/bin/colibri sitl\n"


@pytest.mark.long
@pytest.mark.parametrize(
    ("section", "default_port", "height_m"), [("## MAVSDK", SDK_PORT, 5.0), ("## DroneKit", GROUND_PORT, 7.0)]
)
def test_a_first_program_flies(tmp_path: Path, section: str, default_port: int, height_m: float) -> None:
    port = free_port()
    with vehicle(tmp_path, links=(f"udpout:127.0.0.1:{port}",), speed=SPEED) as flown:
        run(snippets(section)[0], default_port, port, tmp_path)
        assert abs(flown.seen.wait_until_disarmed().height_m) < 0.05
        assert flown.seen.modes()[-1] is Mode.LAND
        assert -0.2 < max(sight.height_m for sight in flown.seen.sights) - height_m < 0.1


@pytest.mark.clients
def test_mavproxy(tmp_path: Path) -> None:
    port = free_port()
    command = snippets("## MAVProxy")[0].split()
    assert command[:1] == ["mavproxy.py"]
    (option,) = command[1:]
    connection = option.removeprefix("--master=").replace(str(GROUND_PORT), str(port))
    arm, take_off, go, return_home = snippets("## MAVProxy")[1].splitlines()
    with (
        vehicle(tmp_path, links=(f"udpout:127.0.0.1:{port}",), speed=SPEED) as flown,
        MavProxy(tmp_path, connection) as proxy,
    ):
        proxy.type(arm, "COMPONENT_ARM_DISARM: ACCEPTED")
        proxy.type(take_off, "NAV_TAKEOFF: ACCEPTED")
        proxy.expect("AP: Takeoff altitude reached: hold")
        proxy.type(go, "DO_REPOSITION: ACCEPTED")
        flown.seen.wait(lambda sight: sight.height_m > 6.9 and hypot(*sight.velocity_enu_m_s) < 0.05, "the place")
        proxy.type(return_home, "NAV_RETURN_TO_LAUNCH: ACCEPTED")
        assert abs(flown.seen.wait_until_disarmed().height_m) < 0.05
        assert closest_m(flown.seen.sights, place(47.3978, 8.5456, 7.0)) < 0.3
        assert hypot(*flown.seen.now.position_enu_m[:2]) < 0.3
