import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from colibri.common.process.folder_lock import FolderLock
from colibri.mavlink.links.open import open_link
from tests.support.commands import FLIGHT, PROFILE, VEHICLE, Refused, edited


def recoded(source: Path) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        path = folder / source.name
        path.write_bytes(source.read_bytes() + b"\n# gr\xf6\xdfer")
        return str(path)

    return write


BAD_OPTIONS = [
    ("", "the following arguments are required: TRACK"),
    ("loop", 'unknown track "loop" (choose spiral, expanding-spiral, line, wave'),
    ("circle:speed=fast", "track circle: speed=fast: Expected `float`, got `str`"),
    ("waypoints:nowhere.csv", "nowhere.csv: No such file or directory"),
    ("spiral --profile fast", 'unknown profile "fast" (choose agile, flight, path, se3, '),
    ("spiral --vehicle dragonfly", 'unknown vehicle "dragonfly" (choose'),
    ("spiral --vehicle \udcfc.toml", "\\udcfc.toml is not UTF-8 by"),
    ("spiral --solver simplex", 'unknown solver "simplex" (choose'),
    ("spiral --solver gurobi", "gurobi is not installed: pip install"),
    ("spiral --profile se3 --solver daqp", "controller geometric-se3 solves no QP: leave --solver out"),
    ("spiral --controller pid", 'unknown controller "pid" (choose cascade, geometric-se3, global-lpv-mpc, lpv-mpc'),
    ("spiral --feedback hope", 'argument --feedback: unknown value "hope" (choose state, sensors)'),
    (
        "spiral --feedback sensors --vehicle hummingbird-thesis",
        "--feedback sensors: vehicle hummingbird-thesis has no table sensors",
    ),
    ("spiral --feedback sensors --without ground", "--feedback sensors: vehicle hummingbird has no ground to stand on"),
    ("spiral --seed -1", "--seed: must be a whole number of at least 0, not -1"),
    ("spiral --speed 0", "--speed: must be a number above 0, or max, not 0"),
    ("spiral --link carrier-pigeon", '--link: unknown value "carrier-pigeon" '),
    ("spiral --without gravity", '--without: unknown value "gravity" (choose '),
    ("spiral --wind 5m/s@west", "argument --wind: must be SPEED@FROM in m/s and degrees, for example 5@270, not 5m"),
    (
        "spiral --wind 5@400",
        "argument --wind: the speed must not be negative, the direction 0 to 360 degrees, not 5@400",
    ),
    ("spiral --wind=-1@90", "argument --wind: the speed must not be negative"),
    ("spiral --wind /none/wind.csv", "argument --wind: /none/wind.csv: No such file or directory"),
    (
        "spiral --gust 6@270",
        "argument --gust: must be SPEED@FROM:start=S,duration=S, for example 6@270:start=10,duration=2, not 6@270",
    ),
    ("spiral --turbulence terrible", 'argument --turbulence: unknown value "terrible" (choose '),
    ("spiral --start x=1,y", "--start: y: must be a number, not empty"),
    ("spiral --start z=high", 'argument --start: z: must be a number, not "high"'),
    ("spiral --start psi=nan", 'argument --start: psi: must be a number, not "nan"'),
    ("spiral --start z=1,roll=3", 'unknown key "roll" (choose x, y, z, phi, theta, psi, vx, vy, vz, p, q, r, rotors'),
    ("spiral --start rotors=9000", "the rotors of AscTec Hummingbird cannot start at 9000 rpm"),
    ("spiral --start rotors=-1", "the rotors of AscTec Hummingbird cannot start at -1 rpm"),
    (
        "spiral --vehicle hummingbird --start z=-1",
        "AscTec Hummingbird would start 1 m below the ground: start it higher",
    ),
]
BAD_FILES = [
    ("spiral --vehicle", recoded(VEHICLE), ": is not UTF-8: save the file as that"),
    ("spiral --vehicle", edited(VEHICLE, "mass_kg = 0.698", ""), "body: Object missing required field `mass_kg`"),
    ("spiral --vehicle", edited(VEHICLE, "mass_kg = 0.698", "mass_kg = -1.0"), "body.mass_kg: Expected `float` > 0.0"),
    (
        "spiral --plant-vehicle",
        edited(VEHICLE, "[body]", "[body]\ncolour = 1"),
        "body: Object contains unknown field `colour`",
    ),
    (
        "spiral --vehicle",
        edited(VEHICLE, 'speed_unit = "rad/s"', 'speed_unit = "rad/sec"'),
        "rotors.speed_unit: Invalid enum value 'rad/sec': choose rad/s, rpm",
    ),
    (
        "spiral --vehicle",
        edited(VEHICLE, "damping_n_s_m = 100.0", "damping_n_s_m = 1e4"),
        "ground.damping_n_s_m 10000 is too large, at most ",
    ),
    (
        "spiral --profile",
        edited(PROFILE, "rotor_speed_rpm = 3000.0", "rotor_speed_rpm = -1.0"),
        "simulation.rotor_speed_rpm: Expected `float` >= 0.0",
    ),
    (
        "spiral --profile",
        edited(FLIGHT, "frame_interval_s = 0.004", "frame_interval_s = 0.003"),
        "simulation.frame_interval_s: 0.003 does not divide the control interval of 0.008 s: choose ",
    ),
    (
        "spiral --profile",
        edited(PROFILE, "horizon = 4   ", "horizon = 0   "),
        "controllers.cascade: attitude.horizon: Expected `int` >= 1",
    ),
    (
        "spiral --profile",
        edited(FLIGHT, "blocks = [1, 2, 3, 5, 7, 10]", "blocks = []"),
        "controllers.lpv-mpc: plan.blocks: Expected `array` of length >= 1",
    ),
    (
        "spiral --profile",
        edited(FLIGHT, '"by-formula"', '"by-hand"'),
        "references: Invalid enum value 'by-hand': choose by-differences, by-formula",
    ),
]
SEEN_BY_THE_AUTOPILOT = ("unknown solver", "gurobi is", "controllers.")
"""Over UDP its process has to be started for these lines; `--controller pid` shows the same in seconds."""


def is_slow(line: str) -> bool:
    return any(each in line for each in SEEN_BY_THE_AUTOPILOT)


@pytest.mark.parametrize(
    ("words", "write", "line", "link"),
    [
        pytest.param(words, write, line, link, marks=pytest.mark.long if link == "udp" and is_slow(line) else ())
        for words, write, line in (*((words, None, line) for words, line in BAD_OPTIONS), *BAD_FILES)
        for link in ("udp", "direct")
    ],
)
def test_bad_input_gets_one_line_and_exit_code_2(
    tmp_path: Path, refused: Refused, words: str, write: Callable[[Path], str] | None, line: str, link: str
) -> None:
    given = [*words.split(), *([write(tmp_path)] if write else [])]
    assert line in refused("fly", f"--link={link}", "--out", tmp_path / "out", *given)


def test_out_that_cannot_be_written(tmp_path: Path, refused: Refused) -> None:
    occupied = tmp_path / "file"
    occupied.touch()
    said = refused("fly", "spiral", "--quiet", "--out", occupied / "out")
    assert said == f"cannot write to --out {occupied / 'out'}: Not a directory"


@pytest.mark.parametrize("command", ["plant --link {url}", "sitl --plant-port {port}"])
def test_a_port_of_the_plant_that_is_taken(command: str, refused: Refused) -> None:
    with closing(open_link("udpin:127.0.0.1:0")) as taken:
        words = command.format(url=taken.url, port=taken.url.rpartition(":")[2]).split()
        said = refused(*words)
    assert said == f"{taken.url}: Address already in use; end the program that has this port, or name another"


def test_a_flight_shorter_than_a_control_sample_is_one_line(tmp_path: Path, refused: Refused) -> None:
    said = refused("fly", "hover", "--duration", "0.001", "--link", "memory", "--out", tmp_path, code=1)
    assert said == "the flight ended before its first control sample: give it a longer --duration"


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
    tmp_path: Path, refused: Refused, command: tuple[str, ...], folder: str
) -> None:
    with FolderLock(tmp_path / folder, "--out"):
        said = refused(*command, "--out", tmp_path)
    assert said == f"--out {tmp_path / folder} is in use by another flight: end that or name another"
