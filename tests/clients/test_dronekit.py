"""DroneKit 2 flies the vehicle, in a process of its own; what it says is held against what an observer sees."""

import subprocess
import sys
from math import dist, hypot
from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from tests.clients.support.geometry import place
from tools.harness.processes import SitlProcess, vehicle

PROGRAMS = Path(__file__).parent / "programs"
SPEED = 4.0
GIVE_UP_AFTER_S = 180.0


def said(program: str, flown: SitlProcess) -> list[str]:
    command = [sys.executable, str(PROGRAMS / program), f"udpout:127.0.0.1:{flown.port}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=GIVE_UP_AFTER_S)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


@pytest.mark.long
def test_it_arms_takes_off_goes_somewhere_and_lands(tmp_path: Path) -> None:
    with vehicle(tmp_path, speed=SPEED) as flown:
        lines = said("dronekit_flight.py", flown)
        assert lines[0] == "connected LOITER False 3 100"
        assert lines[1].startswith("parameters ")
        assert lines[2] == "set 4.5"
        assert [line for line in lines[3:] if not line.startswith("text")] == ["armed", "up", "there", "landed"]
        assert "text Disarmed by landing" in lines

        seen = flown.seen.wait_until_disarmed()
        assert flown.seen.modes()[-3:] == [Mode.TAKEOFF, Mode.HOLD, Mode.LAND]
        assert min(dist(sight.position_enu_m, place(47.3978, 8.5456, 6.0)) for sight in flown.seen.sights) < 0.3
        assert max(hypot(*sight.velocity_enu_m_s[:2]) for sight in flown.seen.sights) < 4.2
        assert not seen.flying
        (kept,) = flown.state.glob("0/*.params")
        assert "MIS_TAKEOFF_ALT\t4.5" in kept.read_text(encoding="utf-8")


@pytest.mark.long
def test_it_flies_a_mission(tmp_path: Path) -> None:
    with vehicle(tmp_path, speed=SPEED) as flown:
        lines = said("dronekit_mission.py", flown)
        assert lines == ["downloaded [16, 16, 21]", "armed", "mission", "last item", "landed"]
        flown.seen.wait_until_disarmed()
        assert [mode for mode in flown.seen.modes() if mode is not Mode.HOLD] == [Mode.MISSION]
        assert min(dist(sight.position_enu_m, place(47.3978, 8.545594, 4.0)) for sight in flown.seen.sights) < 1.0
        assert hypot(*flown.seen.now.position_enu_m[:2]) < 0.3
