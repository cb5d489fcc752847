"""The thesis profile against the thesis's own closed-loop data, and against itself over every link."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from colibri.analysis.recording import ATTITUDE_REFERENCE, COLUMNS, INPUT, STATE
from colibri.plant.spec import PARTS
from tests.support.recorded import begins_as_recorded, max_difference, reference, rows
from tools.harness.processes import fly_thesis

TRACKS = ("spiral", "line")
SETTLED_RMS_M = {"spiral": 0.1254, "line": 0.0578}


@begins_as_recorded
@pytest.mark.parametrize("integrator", ["adaptive", pytest.param("rk4", marks=pytest.mark.long)])
@pytest.mark.parametrize("track", TRACKS)
def test_direct_equals_the_reference(tmp_path: Path, track: str, integrator: str) -> None:
    figures = fly_thesis(tmp_path, track, "--link", "direct", "--integrator", integrator)
    flown, wanted = rows(tmp_path / "flight.csv"), reference(track)
    assert tuple(flown) == COLUMNS
    assert len(flown["t"]) == 1001
    assert max_difference(flown, wanted, ("t", *STATE)) < 1e-8
    assert max_difference(flown, wanted, (*INPUT, *ATTITUDE_REFERENCE)) < 1e-8
    assert max_difference(flown, wanted, ("omega1", "omega2", "omega3", "omega4")) < 1e-4
    assert figures["rmse_after_20s_m"] == pytest.approx(SETTLED_RMS_M[track], abs=5e-5)
    assert (figures["frames"], figures["resent"], figures["qp_failures"]) == (1000, 0, 0)
    # The thesis solved its QP without constraints; ours are only what no rotor could do, and never bind.
    assert max(np.abs(np.diff(flown[name])).max() for name in ("U2", "U3")) < 0.25 * 0.834
    assert max(flown[f"omega{rotor}"].max() for rotor in (1, 2, 3, 4)) < 8002.0


@pytest.mark.parametrize("track", ["spiral", pytest.param("line", marks=pytest.mark.long)])
def test_udp_equals_the_reference_and_memory_bit_for_bit(tmp_path: Path, track: str) -> None:
    flights = [fly_thesis(tmp_path / link, track, "--link", link) for link in ("udp", "memory")]
    assert len({figures["trajectory_sha256"] for figures in flights}) == 1
    flown = rows(tmp_path / "udp" / "flight.csv")
    assert max_difference(flown, reference(track), STATE) < 1e-4
    same = [(tmp_path / name / "flight.csv").read_bytes() for name in ("udp", "memory")]
    assert same[0] == same[1]


def test_the_tlog_opens_in_mavlogdump(tmp_path: Path) -> None:
    fly_thesis(tmp_path, "spiral", "--link", "memory", "--tlog", "--duration", "2")
    mavlogdump = shutil.which("mavlogdump.py", path=str(Path(sys.executable).parent))
    assert mavlogdump is not None
    command = [sys.executable, mavlogdump, str(tmp_path / "flight.tlog")]
    dump = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    counts = {
        name: dump.count(name + " {")
        for name in ("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "HIL_ACTUATOR_CONTROLS", "HEARTBEAT", "BAD_DATA")
    }
    assert counts == {
        "ATTITUDE_QUATERNION": 20,
        "LOCAL_POSITION_NED": 20,
        "HIL_ACTUATOR_CONTROLS": 20,
        "HEARTBEAT": 5,
        "BAD_DATA": 0,
    }


def test_the_si_vehicle_flies_the_spiral_too(tmp_path: Path) -> None:
    ideal = tuple(f"--without={part}" for part in PARTS)
    figures = fly_thesis(
        tmp_path, "spiral", "--link", "memory", "--vehicle", "hummingbird", "--integrator", "rk4", *ideal
    )
    assert figures["rmse_after_20s_m"] == pytest.approx(SETTLED_RMS_M["spiral"], abs=1e-3)
