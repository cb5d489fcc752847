"""A companion on real PX4 and real ArduCopter, with their own physics or on our plant, in a network of their own.

COLIBRI_PX4 is a build folder of PX4's SITL (`build/px4_sitl_default`), COLIBRI_ARDUCOPTER the program `arducopter`.
What is started is ended by its number.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.peers.half_speed import PX4_SETTINGS
from tests.peers.programs import ALONE, program_of

pytestmark = pytest.mark.peers

COPTER_PARAMETERS = {
    "FRAME_CLASS": 1,
    "FRAME_TYPE": 0,
    "GUID_OPTIONS": 8,
    "GUID_TIMEOUT": 0.3,
    "FS_THR_ENABLE": 0,
    "FS_GCS_ENABLE": 0,
    **{f"INS_{part}{axis}": value for axis in "XYZ" for part, value in (("ACCOFFS_", 0.001), ("ACCSCAL_", 1.001))},
    **{f"INS_ACC2{part}{axis}": value for axis in "XYZ" for part, value in (("OFFS_", 0.001), ("SCAL_", 1.001))},
    **{f"COMPASS_OFS{n}_{axis}": value for n in ("", 2, 3) for axis, value in (("X", 5), ("Y", 13), ("Z", -18))},
    "MOT_THST_EXPO": 0.65,
    "MOT_THST_HOVER": 0.39,
    "ATC_RAT_YAW_P": 0.3,
    "ATC_RAT_YAW_I": 0.02,
    "BATT_MONITOR": 4,
}
PX4_INSTANCE = 9
PX4_ALONE_M = {"sihsim": 0.066, "iris": 0.066, "hummingbird": 0.061}
"""RMS of a spiral by PX4's own position control, from its estimate: docs/simulators.md. Of PX4's own physics, where it
strays by 0.28 m, that of the Iris is taken."""
ON_A_BUSY_COMPUTER = "--wait 120 --max-age 500 --max-gap 1000 --min-pace 1"
"""At real time beside other tests all come late now and then; how near to its track the vehicle is to be stays."""
SHELL = """
{beside} > beside.log 2>&1 &
beside=$!
"$@" > vehicle.log 2>&1 &
vehicle=$!
{companion} > companion.log 2>&1
code=$?
kill -KILL $vehicle $beside 2>/dev/null
wait $vehicle $beside 2>/dev/null
exit $code
"""


def fly(folder: Path, vehicle: list[str], options: str, beside: str = "true", **environment: str) -> dict[str, Any]:
    """Fly a vehicle that is started here, and what it needs `beside` it; return the companion's report."""
    out = folder / "out"
    companion = f"{sys.executable} -m colibri companion {options} {ON_A_BUSY_COMPUTER} --out {out}"
    command = [*ALONE, "sh", "-c", SHELL.format(companion=companion, beside=beside), "sh", *vehicle]
    ended = subprocess.run(command, cwd=folder, env=os.environ | environment, check=False, timeout=400.0)
    said = (folder / "companion.log").read_text(encoding="utf-8")
    assert ended.returncode == 0, said
    report: dict[str, Any] = json.loads((out / "report.json").read_text(encoding="utf-8"))
    return report


def arducopter(folder: Path, options: str) -> dict[str, Any]:
    program = program_of("ardupilot")
    parameters = folder / "companion.parm"
    parameters.write_text("".join(f"{name} {value}\n" for name, value in COPTER_PARAMETERS.items()), encoding="utf-8")
    vehicle = [
        *(str(program), "--model", "+", "--speedup", "1", "--home", "47.3977,8.5456,488,0", "-w"),
        *("--defaults", str(parameters), "--serial0", "udpclient:127.0.0.1:14555"),
    ]
    return fly(folder, vehicle, f"{options} --vehicle udpin:127.0.0.1:14555")


def arducopter_on_the_plant(folder: Path, options: str) -> dict[str, Any]:
    program, parameters, colibri = program_of("ardupilot"), folder / "companion.parm", f"{sys.executable} -m colibri"
    told = [*colibri.split(), "vehicle", "hummingbird", "--for", "ardupilot", "--out", str(parameters)]
    subprocess.run(told, check=True)
    others = {name: value for name, value in COPTER_PARAMETERS.items() if not name.startswith(("FRAME_", "MOT_"))}
    with parameters.open("a", encoding="utf-8") as file:
        file.writelines(f"{name} {value}\n" for name, value in others.items())
    vehicle = [
        *(str(program), "--model", "JSON:127.0.0.1", "--speedup", "1", "-w", "--defaults", str(parameters)),
        *("--serial0", "udpclient:127.0.0.1:14555"),
    ]
    plant = f"{colibri} plant --serve ardupilot-json --vehicle hummingbird --out {folder / 'plant'}"
    return fly(folder, vehicle, f"{options} --vehicle udpin:127.0.0.1:14555", plant)


def px4(folder: Path, options: str) -> dict[str, Any]:
    build = program_of("px4")
    vehicle = [str(build / "bin" / "px4"), "-i", str(PX4_INSTANCE), "-d", str(build / "etc")]
    return fly(folder, vehicle, f"{options} --vehicle udpin:127.0.0.1:{14540 + PX4_INSTANCE}", **PX4_SETTINGS)


@pytest.mark.parametrize(("on", "seconds"), [(arducopter, 60), (arducopter_on_the_plant, 40)])
def test_arducopter_is_flown_twice_as_well(
    on: Callable[[Path, str], dict[str, Any]], seconds: int, tmp_path: Path
) -> None:
    report = on(tmp_path, f"spiral --arm --duration {seconds}")
    assert (report["stack"], report["in_order"]) == ("ardupilot", True)
    assert report["control_rmse_m"] <= 0.045 / 2.0


def test_arducopter_is_identified(tmp_path: Path) -> None:
    report = arducopter(tmp_path, "--identify --arm")
    assert report["in_order"]
    assert "time_constant_s" in (tmp_path / "out" / "companion.toml").read_text(encoding="utf-8")


def test_px4_is_flown_and_left_in_hold(tmp_path: Path) -> None:
    report = px4(tmp_path, "hover:height=3 --arm --duration 10 --controller lpv-mpc")
    assert report["stack"] == "px4"
    assert report["in_order"]
    assert report["control_rmse_m"] < 0.3


@pytest.mark.parametrize("name", PX4_ALONE_M)
def test_px4_is_flown_twice_as_well_as_by_itself(name: str, tmp_path: Path) -> None:
    command = [*ALONE, sys.executable, "-m", "tests.peers.tracks", str(program_of("px4")), str(tmp_path), name]
    subprocess.run(command, check=True, timeout=500.0)
    flown = json.loads((tmp_path / "track.json").read_text(encoding="utf-8"))
    assert flown["in_order"], flown["ended"]
    assert flown["rmse_m"] <= PX4_ALONE_M[name] / 2.0
