import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from colibri.common.process.folder_lock import FolderLock
from colibri.mavlink.links.open import open_link
from tests.support.commands import FLIGHT, PROFILE, VEHICLE, Refused, edited

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
BAD_VEHICLES = (
    ("mass_kg = 0.698", "", "body: Object missing required field `mass_kg`"),
    ("mass_kg = 0.698", "mass_kg = -1.0", "body.mass_kg: Expected `float` > 0.0"),
    ("[body]", "[body]\ncolour = 1", "body: Object contains unknown field `colour`"),
    ('"rad/s"', '"rad/sec"', "rotors.speed_unit: Invalid enum value 'rad/sec': choose rad/s, rpm"),
    ("damping_n_s_m = 100.0", "damping_n_s_m = 1e4", "ground.damping_n_s_m 10000 is too large, at most "),
)
BAD_PROFILES = (
    ("frame_interval_s = 0.004", "frame_interval_s = 0.003", "0.003 does not divide the control interval of 0.008 s: "),
    (
        "blocks = [1, 2, 3, 5, 7, 10]",
        "blocks = []",
        "controllers.lpv-mpc: plan.blocks: Expected `array` of length >= 1",
    ),
    ('"by-formula"', '"by-hand"', "Invalid enum value 'by-hand': choose by-differences, by-formula"),
)
BAD_FILES = [
    *(("--vehicle", VEHICLE, *row) for row in BAD_VEHICLES),
    *(("--profile", FLIGHT, *row) for row in BAD_PROFILES),
    ("--plant-vehicle", VEHICLE, "[body]", "[body]\ncolour = 1", "body: Object contains unknown field `colour`"),
    ("--profile", PROFILE, "rpm = 3000.0", "rpm = -1.0", "simulation.rotor_speed_rpm: Expected `float` >= 0.0"),
    ("--profile", PROFILE, "on = 4   ", "on = 0   ", "controllers.cascade: attitude.horizon: Expected `int` >= 1"),
]
SEEN_BY_THE_AUTOPILOT = ("unknown solver", "gurobi is", "controllers.")
"""Over UDP its process has to be started for these lines; `--controller pid` shows the same in seconds."""


def on_both_links(rows: Sequence[tuple[Any, ...]]) -> list[Any]:
    slow = [row for row in rows if any(each in row[-1] for each in SEEN_BY_THE_AUTOPILOT)]
    over_udp = [pytest.param("udp", *row, marks=pytest.mark.long if row in slow else ()) for row in rows]
    return [*over_udp, *(("direct", *row) for row in rows)]


@pytest.mark.parametrize(("link", "words", "line"), on_both_links(BAD_OPTIONS))
def test_bad_options_get_one_line(tmp_path: Path, refused: Refused, link: str, words: str, line: str) -> None:
    assert line in refused("fly", f"--link={link}", "--out", tmp_path / "out", *words.split())


@pytest.mark.parametrize(("link", "option", "source", "old", "new", "line"), on_both_links(BAD_FILES))
def test_bad_files_get_one_line(
    tmp_path: Path, refused: Refused, link: str, option: str, source: Path, old: str, new: str, line: str
) -> None:
    words = ("fly", "spiral", option, edited(tmp_path, source, old, new))
    assert line in refused(*words, f"--link={link}", "--out", tmp_path / "out")


def test_a_file_in_another_encoding_is_refused(tmp_path: Path, refused: Refused) -> None:
    path = tmp_path / VEHICLE.name
    path.write_bytes(VEHICLE.read_bytes() + b"\n# gr\xf6\xdfer")
    assert ": is not UTF-8: save the file as that" in refused("fly", "spiral", "--vehicle", path)


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
