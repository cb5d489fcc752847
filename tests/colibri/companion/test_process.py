import csv
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.commands import Refused
from tools.harness.processes import vehicle

LINK = "udpin:127.0.0.1:0"
MISSION = """{"mission": {"plannedHomePosition": [47.0, 8.0, 400.0], "items": [
{"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, null, 47.397742, 8.545594, 2]},
{"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, null, 47.397752, 8.545594, 3]}]}}"""


def test_a_mission_without_a_vehicle_that_says_where_home_is(tmp_path: Path, refused: Refused) -> None:
    mission = tmp_path / "there.plan"
    mission.write_text(MISSION, encoding="utf-8")
    said = refused("companion", mission, "--vehicle", LINK, "--wait", "0.01", "--out", tmp_path / "out")
    assert "home position, which was not received" in said


def companion(out: Path, port: int, *options: str) -> subprocess.CompletedProcess[str]:
    link = f"udpout:127.0.0.1:{port}"
    command = [sys.executable, "-m", "colibri", "companion", *options, "--vehicle", link, "--out", str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_a_dry_run_over_udp_logs_and_moves_nothing(tmp_path: Path) -> None:
    mission = tmp_path / "there.plan"
    mission.write_text(MISSION, encoding="utf-8")
    with vehicle(tmp_path) as flown:
        options = ["--dry-run", "--duration", "1", "--min-pace", "1", "--max-age", "20000", "--max-gap", "20000"]
        ended = companion(tmp_path / "out", flown.port, str(mission), *options)
        assert ended.returncode == 0, ended.stderr
        assert not any(sight.armed for sight in flown.seen.sights)
        late = companion(tmp_path / "late", flown.port, "hover", "--dry-run", "--wait", "0.3")
        assert (late.returncode, "timed out" in late.stderr) == (1, True)
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert (report["stack"], report["setpoints"], report["in_order"]) == ("colibri", 0, True)
    rows = list(csv.DictReader((tmp_path / "out" / "companion.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) > 20
    assert {row["sent"] for row in rows} == {"0"}


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_hands_over_and_a_second_one_too(tmp_path: Path, number: signal.Signals) -> None:
    with vehicle(tmp_path) as flown:
        options = ["hover:height=2", "--arm", "--max-age", "20000", "--max-gap", "20000", "--min-pace", "1"]
        command = [sys.executable, "-m", "colibri", "companion", *options, "--out", str(tmp_path / "out")]
        command += ["--vehicle", f"udpout:127.0.0.1:{flown.port}"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            assert any("flying:" in line for line in process.stderr)
            process.send_signal(number)
            process.send_signal(number)
            said = process.stderr.read()
        assert process.returncode == 0, said
        assert f"{number.name}: it ends" in said
        assert flown.seen.sights[-1].mode == "hold"
    assert json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))["in_order"]


@pytest.mark.long
def test_a_flight_over_udp_is_handed_over_in_order(tmp_path: Path) -> None:
    with vehicle(tmp_path) as flown:
        late = "--max-age 20000 --max-gap 20000 --min-pace 1"
        options = f"hover:height=2 --arm --duration 3 {late}".split()
        ended = companion(tmp_path / "out", flown.port, *options)
        assert ended.returncode == 0, ended.stderr
        assert "Takeoff altitude reached: hold" in flown.said
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert report["control_rmse_m"] < 0.5
    assert report["lost"] is None
