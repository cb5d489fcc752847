"""What bad input gets: one line and an exit code."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from colibri.cli.main import main
from colibri.common.process.folder_lock import FolderLock
from colibri.mavlink.links.open import open_link
from tests.support.commands import FLIGHT, PROFILE, VEHICLE, edited, exit_code


def recoded(source: Path) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        path = folder / source.name
        path.write_bytes(source.read_bytes() + b"\n# gr\xf6\xdfer")
        return str(path)

    return write


BAD_INPUT: dict[str, tuple[tuple[str | Callable[[Path], str], ...], str]] = {
    "track": (("loop",), 'unknown track "loop" (choose spiral, expanding-spiral, line, wave'),
    "track option": (("circle:speed=fast",), "track circle: speed=fast: Expected `float`, got `str`"),
    "waypoints": (("waypoints:nowhere.csv",), "nowhere.csv: No such file or directory"),
    "profile": (("spiral", "--profile", "fast"), 'unknown profile "fast" (choose flight, path, se3, '),
    "vehicle": (("spiral", "--vehicle", "dragonfly"), 'unknown vehicle "dragonfly" (choose'),
    "solver": (("spiral", "--solver", "simplex"), "unknown solver simplex: installed are"),
    "extra": (("spiral", "--solver", "gurobi"), "gurobi is not installed: pip install"),
    "feedback": (("spiral", "--feedback", "hope"), 'argument --feedback: unknown value "hope" (choose state, sensors)'),
    "no sensors": (
        ("spiral", "--feedback", "sensors", "--vehicle", "hummingbird-thesis"),
        "--feedback sensors: vehicle hummingbird-thesis has no table sensors",
    ),
    "no ground to stand on": (
        ("spiral", "--feedback", "sensors", "--without", "ground"),
        "--feedback sensors: vehicle hummingbird has no ground to stand on",
    ),
    "seed": (("spiral", "--seed", "-1"), "--seed: must be a whole number of at least 0, not -1"),
    "missing key": (
        ("spiral", "--vehicle", edited(VEHICLE, "mass_kg = 0.698", "")),
        "hummingbird.toml: body: Object missing required field `mass_kg`",
    ),
    "unknown key": (
        ("spiral", "--plant-vehicle", edited(VEHICLE, "[body]", "[body]\ncolour = 1")),
        "hummingbird.toml: body: Object contains unknown field `colour`",
    ),
    "impossible value": (
        ("spiral", "--vehicle", edited(VEHICLE, "mass_kg = 0.698", "mass_kg = -1.0")),
        "hummingbird.toml: body.mass_kg: Expected `float` > 0.0",
    ),
    "profile key": (
        ("spiral", "--profile", edited(PROFILE, "horizon = 4   ", "horizon = 0   ")),
        "thesis.toml: controllers.cascade: attitude.horizon: Expected `int` >= 1",
    ),
    "no blocks": (
        ("spiral", "--profile", edited(FLIGHT, "blocks = [1, 2, 3, 5, 7, 10]", "blocks = []")),
        "flight.toml: controllers.whole-lpv-mpc: plan.blocks: Expected `array` of length >= 1",
    ),
    "frames that divide nothing": (
        ("spiral", "--profile", edited(FLIGHT, "frame_interval_s = 0.004", "frame_interval_s = 0.003")),
        "flight.toml: simulation.frame_interval_s: 0.003 does not divide the control interval of 0.008 s: choose ",
    ),
    "hard ground": (
        ("spiral", "--vehicle", edited(VEHICLE, "damping_n_s_m = 100.0", "damping_n_s_m = 1e4")),
        "hummingbird.toml: ground.damping_n_s_m 10000 is too large, at most ",
    ),
    "profile file": (
        ("spiral", "--profile", edited(PROFILE, "rotor_speed_rpm = 3000.0", "rotor_speed_rpm = -1.0")),
        "thesis.toml: simulation.rotor_speed_rpm: Expected `float` >= 0.0",
    ),
    "choice": (
        ("spiral", "--vehicle", edited(VEHICLE, 'speed_unit = "rad/s"', 'speed_unit = "rad/sec"')),
        "hummingbird.toml: rotors.speed_unit: Invalid enum value 'rad/sec': choose rad/s, rpm",
    ),
    "choice of a law": (
        (
            *("spiral", "--controller", "lpv-mpc", "--profile"),
            edited(FLIGHT, '"along-plan"', '"ahead"'),
        ),
        "flight.toml: controllers.lpv-mpc: attitude.scheduling: Invalid enum value 'ahead': choose along-plan, frozen",
    ),
    "no text": (("spiral", "--vehicle", recoded(VEHICLE)), ": is not UTF-8: save the file as that"),
    "start": (("spiral", "--start", "x=1,y"), "--start: y: must be a number, not nothing"),
    "no UTF-8": (("spiral", "--vehicle", "\udcfc.toml"), "\\udcfc.toml is not UTF-8 by"),
    "controller": (
        ("spiral", "--controller", "pid"),
        'unknown controller "pid" (choose cascade, geometric-se3, global-lpv-mpc, lpv-mpc',
    ),
    "no QP": (
        ("spiral", "--profile", "se3", "--solver", "daqp"),
        "controller geometric-se3 solves no QP: leave --solver out",
    ),
    "speed": (("spiral", "--speed", "0"), "--speed: must be a number above 0, or max, not 0"),
    "wind": (
        ("spiral", "--wind", "5m/s@west"),
        "argument --wind: must be SPEED@FROM in m/s and degrees, 5@270 say, not 5m/s@west",
    ),
    "wind direction": (
        ("spiral", "--wind", "5@400"),
        "argument --wind: the speed must not be negative, the direction 0 to 360 degrees, not 5@400",
    ),
    "wind file": (("spiral", "--wind", "/none/wind.csv"), "argument --wind: /none/wind.csv: No such file or directory"),
    "gust": (
        ("spiral", "--gust", "6@270"),
        "argument --gust: must be SPEED@FROM:start=S,duration=S, 6@270:start=10,duration=2 say, not 6@270",
    ),
    "turbulence": (("spiral", "--turbulence", "terrible"), 'argument --turbulence: unknown value "terrible" (choose '),
    "part": (("spiral", "--without", "gravity"), '--without: unknown value "gravity" (choose '),
    "start key": (
        ("spiral", "--start", "z=1,roll=3"),
        'argument --start: unknown key "roll" (choose x, y, z, phi, theta, psi, vx, vy, vz, p, q, r, rotors',
    ),
    "start value": (("spiral", "--start", "z=high"), "argument --start: z: must be a number, not high"),
    "start speed": (("spiral", "--start", "rotors=9000"), "the rotors of AscTec Hummingbird cannot start at 9000 rpm"),
    "start in the ground": (
        ("spiral", "--vehicle", "hummingbird", "--start", "z=-1"),
        "AscTec Hummingbird would start 1 m below the ground: start it higher",
    ),
    "link": (("spiral", "--link", "carrier-pigeon"), '--link: unknown value "carrier-pigeon" '),
    "command": ((), "the following arguments are required: TRACK"),
}

SEEN_BY_THE_AUTOPILOT = ("choice of a law", "extra", "no blocks", "profile key", "solver")
"""Over UDP its process has to be started for it; `controller` shows the same of such a one in seconds."""


@pytest.mark.parametrize(
    ("arguments", "line", "link"),
    [
        pytest.param(*BAD_INPUT[what], link, id=f"{what}-{link}", marks=marks)
        for what in BAD_INPUT
        for link, marks in (("udp", pytest.mark.long if what in SEEN_BY_THE_AUTOPILOT else ()), ("direct", ()))
    ],
)
def test_bad_input_gets_one_line_and_exit_code_2(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    link: str,
    arguments: tuple[str | Callable[[Path], str], ...],
    line: str,
) -> None:
    written = [each if isinstance(each, str) else each(tmp_path) for each in arguments]
    command = ["fly", "--link", link, "--out", str(tmp_path / "out"), *written]
    assert exit_code(command) == 2
    said = capfd.readouterr()
    assert line in said.err
    assert said.err.startswith("colibri: error: ")
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_out_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    occupied = tmp_path / "file"
    occupied.touch()
    with pytest.raises(SystemExit) as ended:
        main(["fly", "spiral", "--quiet", "--out", str(occupied / "out")])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"colibri: error: cannot write to --out {occupied / 'out'}: Not a directory\n"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--wind=-1@90"], "argument --wind: the speed must not be negative"),
        (["--start", "psi=nan"], "argument --start: psi: must be a number, not nan"),
        (["--start", "psi"], "argument --start: psi: must be a number, not "),
        (["--without", "air"], 'argument --without: unknown value "air" (choose '),
        (["--start", "rotors=-1"], "the rotors of AscTec Hummingbird cannot start at -1 rpm"),
    ],
)
def test_a_plant_that_cannot_start(options: list[str], line: str) -> None:
    command = [sys.executable, "-m", "colibri.plant", "--link", "udpin:127.0.0.1:0", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert f"colibri: error: {line}" in done.stderr.splitlines()[-1]


def test_a_taken_port() -> None:
    taken = open_link("udpin:127.0.0.1:0")
    command = [sys.executable, "-m", "colibri.plant", "--link", taken.url]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    taken.close()
    assert done.returncode == 2
    assert done.stderr.startswith(f"colibri: error: {taken.url}: Address already in use; ")
    assert done.stderr.count("\n") == 1


def test_a_flight_shorter_than_a_control_sample_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(["fly", "hover", "--duration", "0.001", "--link", "memory", "--out", str(tmp_path)]) == 1
    said = "colibri: error: the flight ended before its first control sample: give it a longer --duration\n"
    assert capsys.readouterr().err == said


def test_what_a_stream_cannot_encode_is_escaped(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "colibri", "fly", "wäypoint", "--out", str(tmp_path)]
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, env=ascii_only, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "w\\xe4ypoint" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "folder"),
    [(("fly", "hover"), "."), (("compare", "--track", "hover"), "."), (("sitl", "--plant-port", "0"), "0")],
    ids=["fly", "compare", "sitl"],
)
def test_a_second_flight_into_one_folder_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], command: tuple[str, ...], folder: str
) -> None:
    with FolderLock(tmp_path / folder, "--out"), pytest.raises(SystemExit) as ended:
        main([*command, "--out", str(tmp_path)])
    assert ended.value.code == 2
    in_use = f"--out {tmp_path / folder} is in use by another flight: end that or name another"
    assert capfd.readouterr().err == f"colibri: error: {in_use}\n"
