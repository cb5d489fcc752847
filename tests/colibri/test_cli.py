"""The command line: what bad input gets, and how a flight is interrupted."""

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from errno import ENOSPC
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import psutil
import pytest

from colibri.cli.main import SUBCOMMANDS, main
from colibri.cli.shared.processes import PROCESSES
from colibri.common.process.folder_lock import FolderLock
from colibri.flights.provenance import plan_of
from colibri.mavlink.links.open import open_link
from tools.harness.processes import wait_for

VEHICLE = Path(__file__).parents[2] / "plant" / "vehicle" / "models" / "hummingbird.toml"
FIGURES = ("trajectory", "position", "attitude", "inputs", "rotors", "error")
MAX_HELP_S = 0.2
"""Of a core, startup of Python included."""
HELP = """
import sys
from colibri.cli.main import SUBCOMMANDS, main
from colibri.cli.shared.processes import PROCESSES
try:
    main(["--help"])
finally:
    print(*sys.modules, file=sys.stderr)
"""
PROFILE = Path(__file__).parents[2] / "autopilot" / "profiles" / "thesis.toml"
FLIGHT = PROFILE.with_name("flight.toml")


def edited(source: Path, old: str, new: str) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        text = source.read_text(encoding="utf-8")
        assert text.count(old) == 1
        path = folder / source.name
        path.write_text(text.replace(old, new), encoding="utf-8")
        return str(path)

    return write


def recoded(source: Path) -> Callable[[Path], str]:
    def write(folder: Path) -> str:
        path = folder / source.name
        path.write_bytes(source.read_bytes() + b"\n# gr\xf6\xdfer")
        return str(path)

    return write


def plain(text: str) -> Callable[[Path], str]:
    return lambda _folder: text


BAD_INPUT = {
    "track": ((plain("loop"),), "unknown track loop: choose spiral, expanding-spiral, line, wave"),
    "track option": ((plain("circle:speed=fast"),), "track circle: speed=fast: Expected `float`, got `str`"),
    "waypoints": ((plain("waypoints:nowhere.csv"),), "nowhere.csv: No such file or directory"),
    "profile": (
        (plain("spiral"), plain("--profile"), plain("fast")),
        "unknown profile fast: choose flight, path, se3, ",
    ),
    "vehicle": ((plain("spiral"), plain("--vehicle"), plain("dragonfly")), "unknown vehicle dragonfly: choose"),
    "solver": ((plain("spiral"), plain("--solver"), plain("simplex")), "unknown solver simplex: installed are"),
    "extra": ((plain("spiral"), plain("--solver"), plain("gurobi")), "gurobi is not installed: pip install"),
    "feedback": (
        (plain("spiral"), plain("--feedback"), plain("hope")),
        "argument --feedback: must be state or sensors",
    ),
    "no sensors": (
        (plain("spiral"), plain("--feedback"), plain("sensors"), plain("--vehicle"), plain("hummingbird-thesis")),
        "--feedback sensors: vehicle hummingbird-thesis has no table sensors",
    ),
    "no ground to stand on": (
        (plain("spiral"), plain("--feedback"), plain("sensors"), plain("--without"), plain("ground")),
        "--feedback sensors: vehicle hummingbird has no ground to stand on",
    ),
    "seed": ((plain("spiral"), plain("--seed"), plain("-1")), "argument --seed: must not be below zero, not -1"),
    "missing key": (
        (plain("spiral"), plain("--vehicle"), edited(VEHICLE, "mass_kg = 0.698", "")),
        "hummingbird.toml: body: Object missing required field `mass_kg`",
    ),
    "unknown key": (
        (plain("spiral"), plain("--plant-vehicle"), edited(VEHICLE, "[body]", "[body]\ncolour = 1")),
        "hummingbird.toml: body: Object contains unknown field `colour`",
    ),
    "impossible value": (
        (plain("spiral"), plain("--vehicle"), edited(VEHICLE, "mass_kg = 0.698", "mass_kg = -1.0")),
        "hummingbird.toml: body.mass_kg: Expected `float` > 0.0",
    ),
    "profile key": (
        (plain("spiral"), plain("--profile"), edited(PROFILE, "horizon = 4   ", "horizon = 0   ")),
        "thesis.toml: controllers.cascade: attitude.horizon: Expected `int` >= 1",
    ),
    "no moves": (
        (plain("spiral"), plain("--profile"), edited(FLIGHT, "moves = [1, 1, 2, 4, 5, 7]", "moves = []")),
        "flight.toml: controllers.lpv-mpc: attitude.moves: Expected `array` of length >= 1",
    ),
    "frames that divide nothing": (
        (plain("spiral"), plain("--profile"), edited(FLIGHT, "frame_interval_s = 0.004", "frame_interval_s = 0.003")),
        "flight.toml: simulation.frame_interval_s: 0.003 does not divide the control interval of 0.008 s: choose ",
    ),
    "hard ground": (
        (plain("spiral"), plain("--vehicle"), edited(VEHICLE, "damping_n_s_m = 100.0", "damping_n_s_m = 1e4")),
        "hummingbird.toml: ground.damping_n_s_m 10000 is too large, at most ",
    ),
    "profile file": (
        (plain("spiral"), plain("--profile"), edited(PROFILE, "rotor_speed_rpm = 3000.0", "rotor_speed_rpm = -1.0")),
        "thesis.toml: simulation.rotor_speed_rpm: Expected `float` >= 0.0",
    ),
    "choice": (
        (plain("spiral"), plain("--vehicle"), edited(VEHICLE, 'speed_unit = "rad/s"', 'speed_unit = "rad/sec"')),
        "hummingbird.toml: rotors.speed_unit: Invalid enum value 'rad/sec': choose rad/s, rpm",
    ),
    "choice of a law": (
        (plain("spiral"), plain("--profile"), edited(FLIGHT, '"along-plan"', '"ahead"')),
        "flight.toml: controllers.lpv-mpc: attitude.scheduling: Invalid enum value 'ahead': choose along-plan, frozen",
    ),
    "no text": ((plain("spiral"), plain("--vehicle"), recoded(VEHICLE)), ": is not UTF-8: save the file as that"),
    "start": (
        (plain("spiral"), plain("--start"), plain("x=1,y")),
        "--start: y: must be a number, not nothing",
    ),
    "no UTF-8": (
        (plain("spiral"), plain("--vehicle"), plain("\udcfc.toml")),
        "\\udcfc.toml is not UTF-8 by",
    ),
    "controller": (
        (plain("spiral"), plain("--controller"), plain("pid")),
        "unknown controller pid: installed are cascade, geometric-se3, global-lpv-mpc, lpv-mpc",
    ),
    "no QP": (
        (plain("spiral"), plain("--profile"), plain("se3"), plain("--solver"), plain("daqp")),
        "controller geometric-se3 solves no QP: leave --solver out",
    ),
    "speed": ((plain("spiral"), plain("--speed"), plain("0")), "argument --speed: must be above zero, not 0"),
    "wind": (
        (plain("spiral"), plain("--wind"), plain("5m/s@west")),
        "argument --wind: must be SPEED@FROM in m/s and degrees, 5@270 say, not 5m/s@west",
    ),
    "wind direction": (
        (plain("spiral"), plain("--wind"), plain("5@400")),
        "argument --wind: the speed must not be negative, the direction 0 to 360 degrees, not 5@400",
    ),
    "wind file": (
        (plain("spiral"), plain("--wind"), plain("/none/wind.csv")),
        "argument --wind: /none/wind.csv: No such file or directory",
    ),
    "gust": (
        (plain("spiral"), plain("--gust"), plain("6@270")),
        "argument --gust: must be SPEED@FROM:start=S,duration=S, 6@270:start=10,duration=2 say, not 6@270",
    ),
    "turbulence": (
        (plain("spiral"), plain("--turbulence"), plain("terrible")),
        "argument --turbulence: invalid choice: 'terrible'",
    ),
    "part": ((plain("spiral"), plain("--without"), plain("gravity")), "argument --without: invalid choice: 'gravity'"),
    "start key": (
        (plain("spiral"), plain("--start"), plain("z=1,roll=3")),
        "argument --start: unknown key roll: choose x, y, z, phi, theta, psi, vx, vy, vz, p, q, r, rotors",
    ),
    "start value": (
        (plain("spiral"), plain("--start"), plain("z=high")),
        "argument --start: z: must be a number, not high",
    ),
    "start speed": (
        (plain("spiral"), plain("--start"), plain("rotors=9000")),
        "the rotors of AscTec Hummingbird cannot start at 9000 rpm",
    ),
    "start in the ground": (
        (plain("spiral"), plain("--vehicle"), plain("hummingbird"), plain("--start"), plain("z=-1")),
        "AscTec Hummingbird would start 1 m below the ground: start it higher",
    ),
    "link": ((plain("spiral"), plain("--link"), plain("carrier-pigeon")), "argument --link: invalid choice"),
    "command": ((), "the following arguments are required: TRACK"),
}

SEEN_BY_THE_AUTOPILOT = ("choice of a law", "extra", "no moves", "profile key", "solver")
"""Over UDP its process has to be started for it; `controller` shows the same of such a one in seconds."""


def exit_code(command: list[str]) -> int | str | None:
    """Run a command; return what the shell would see."""
    try:
        return main(command)
    except SystemExit as ended:
        return ended.code


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
    arguments: tuple[Callable[[Path], str], ...],
    line: str,
) -> None:
    command = ["fly", "--link", link, "--out", str(tmp_path / "out"), *(make(tmp_path) for make in arguments)]
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


@pytest.mark.parametrize("command", SUBCOMMANDS)
def test_every_subcommand_has_options_and_a_call(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code([command, "--help"]) == 0
    assert capsys.readouterr().out.startswith(f"usage: colibri {command} ")
    assert callable(import_module(f"colibri.cli.{command}").run)


def test_help_names_every_command_and_loads_nothing_that_is_large() -> None:
    took_s = []
    for _ in range(5):
        before_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=True)
        took_s.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before_s)
    for command in (*SUBCOMMANDS, *PROCESSES):
        assert f"\n    {command}" in done.stdout
    assert not {"numpy", "numba", "msgspec", "pymavlink", "rich"} & set(done.stderr.split())
    assert min(took_s) < MAX_HELP_S


@pytest.mark.parametrize("package", ["plant", "autopilot"])
def test_help_says_what_a_stranger_needs(package: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", f"colibri.{package}", "--help"], capture_output=True, text=True, check=True
    )
    assert f"Example: colibri {package}" in done.stdout
    assert "14560" in done.stdout


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--wind=-1@90"], "argument --wind: the speed must not be negative"),
        (["--start", "psi=nan"], "argument --start: psi: must be a number, not nan"),
        (["--start", "psi"], "argument --start: psi: must be a number, not "),
        (["--without", "air"], "argument --without: invalid choice: 'air'"),
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


def test_an_unknown_option_points_to_the_help_of_its_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(["compare", "--tracks", "hover"]) == 2
    said = "colibri: error: unrecognized arguments: --tracks hover (see colibri compare --help)\n"
    assert capsys.readouterr().err == said


def test_a_flight_shorter_than_a_control_sample_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(["fly", "hover", "--duration", "0.001", "--link", "memory", "--out", str(tmp_path)]) == 1
    said = "colibri: error: the flight ended before its first control sample: give it a longer --duration\n"
    assert capsys.readouterr().err == said


def test_the_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_code(["--version"]) == 0
    assert capsys.readouterr().out == f"colibri {version('colibri-sitl')}\n"


@pytest.mark.parametrize(("what", "file"), [("profile", FLIGHT), ("vehicle", VEHICLE)])
def test_a_file_of_colibris_own_is_shown_to_be_copied(
    what: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert exit_code(["show", what, file.stem]) == 0
    assert capsys.readouterr().out == file.read_text(encoding="utf-8")
    assert exit_code(["show", what, "nobody"]) == 2
    assert capsys.readouterr().err.startswith(f"colibri: error: unknown {what} nobody: choose ")


def test_figures_are_drawn_of_what_a_flight_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By what is in its folder alone: neither its profile nor its waypoints are there any more."""
    profile, points = edited(FLIGHT, 'name = "flight"', 'name = "mine"')(tmp_path), tmp_path / "points.csv"
    points.write_text("x,y,z\n0,0,1\n2,0,2\n", encoding="utf-8")
    out = tmp_path / "out"
    options = ("--profile", profile, "--link", "memory", "--duration", "0.5", "--wind", "2@270", "--no-figures")
    assert exit_code(["fly", f"waypoints:{points}", *options, "--quiet", "--out", str(out)]) == 0
    Path(profile).unlink()
    points.unlink()
    (out / "report.json").unlink()
    assert exit_code(["plot", str(out)]) == 0
    drawn = capsys.readouterr().out.split()
    assert drawn == [str(out / f"{name}.png") for name in FIGURES]
    assert all(Path(path).stat().st_size > 10_000 for path in drawn)
    assert exit_code(["plot", str(tmp_path)]) == 2
    assert "provenance.json is missing" in capsys.readouterr().err


def test_figures_that_find_no_room_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(ENOSPC, os.strerror(ENOSPC))

    assert exit_code(["fly", "hover", "--link", "memory", "--duration", "0.1", "--quiet", "--out", str(tmp_path)]) == 0
    monkeypatch.setattr("colibri.analysis.figures.draw_flight", full)
    assert exit_code(["plot", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"colibri: error: {tmp_path}: No space left on device\n"


def test_titles_name_a_law_that_is_not_the_profiles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--link", "memory", "--duration", "0.1", "--no-figures", "--out", str(tmp_path))
    assert exit_code(["fly", "hover", "--controller", "geometric-se3", *options]) == 0
    assert capsys.readouterr().out.startswith("hover, profile flight, controller geometric-se3")
    assert plan_of(tmp_path).flown_by == "profile flight, controller geometric-se3"


def fly_slowly(out: Path) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "colibri", "fly", "spiral", "--speed", "10", "--no-figures", "--out", str(out)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True)


def has_flown(out: Path) -> bool:
    log = out / "plant.csv"
    return log.exists() and log.stat().st_size > 10_000


@pytest.mark.parametrize("whom", ["group", pytest.param("parent", marks=pytest.mark.long)])
def test_ctrl_c_ends_all_and_keeps_what_was_logged(tmp_path: Path, whom: str) -> None:
    """A terminal interrupts the whole group; `kill` ends only the command itself."""
    flight = fly_slowly(tmp_path)
    wait_for(lambda: has_flown(tmp_path), "the flight to begin")
    children = psutil.Process(flight.pid).children(recursive=True)
    assert len(children) == 2
    if whom == "group":
        os.killpg(flight.pid, signal.SIGINT)
    else:
        flight.send_signal(signal.SIGTERM)
    _, said = flight.communicate(timeout=60.0)
    assert flight.returncode == 130
    assert said.splitlines()[-1] == f"colibri: error: interrupted; what was logged is in {tmp_path}"
    assert "Traceback" not in said
    assert not any(child.is_running() for child in children)
    flown = (tmp_path / "flight.csv").read_text(encoding="utf-8").splitlines()
    assert len(flown) > 10
    assert flown[0].startswith("t,u,v,w,p,q,r,x,y,z,phi,theta,psi,U1")


@pytest.mark.parametrize("name", ["autopilot", pytest.param("plant", marks=pytest.mark.long)])
def test_a_process_that_dies_ends_the_flight_in_words(tmp_path: Path, name: str) -> None:
    flight = fly_slowly(tmp_path)
    wait_for(lambda: has_flown(tmp_path), "the flight to begin")
    children = psutil.Process(flight.pid).children(recursive=True)
    (victim,) = (child for child in children if name in child.cmdline()[3])
    victim.send_signal(signal.SIGKILL)
    _, said = flight.communicate(timeout=60.0)
    assert flight.returncode == 1
    expected = f"colibri: error: the {name} was killed by SIGKILL; what was logged is in {tmp_path}"
    assert said.splitlines()[-1] == expected
    assert not any(child.is_running() for child in children)


def test_no_process_outlives_a_parent_that_was_killed(tmp_path: Path) -> None:
    flight = fly_slowly(tmp_path)
    wait_for(lambda: has_flown(tmp_path), "the flight to begin")
    children = psutil.Process(flight.pid).children(recursive=True)
    flight.kill()
    flight.communicate()
    wait_for(lambda: not any(alive(child) for child in children), "both processes to end")


@pytest.mark.parametrize("package", ["plant", "autopilot"])
def test_a_process_whose_parent_was_gone_before_it_began_ends(package: str) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    link = ("--link", "udpin:127.0.0.1:0") if package == "plant" else ("--plant", "udpout:127.0.0.1:9")
    command = [sys.executable, "-m", f"colibri.{package}", "--json", "--parent", str(gone.pid), *link]
    assert subprocess.run(command, capture_output=True, check=False, timeout=60.0).returncode == 130


def alive(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE


def test_a_flight_leaves_what_the_readme_names(tmp_path: Path) -> None:
    assert main(["fly", "crown", "--duration", "21", "--seed", "7", "--quiet", "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert {
        "track": "crown",
        "profile": "flight",
        "link": "udp",
        "seed": 7,
        "solver": "daqp",
    }.items() <= report.items()
    assert set(report["solve_time_us"]) == set(report["control_step_us"]) == {"p50", "p99", "max"}
    assert report["sim_time_s"] == 21.0
    assert report["real_time_factor"] == pytest.approx(21.0 / report["wall_time_s"])
    assert 0.0 < report["rmse_after_20s_m"] <= report["rmse_m"] <= report["max_error_m"]
    assert len(report["trajectory_sha256"]) == 64
    assert {"flight.csv", "flight.tlog"} <= {path.name for path in tmp_path.iterdir()}
    assert len(list(tmp_path.glob("*.png"))) == 6


@pytest.mark.parametrize(
    "options",
    [("fly", "hover", "--link", "udp", "--no-figures"), ("compare", "--track", "hover")],
    ids=["fly", "compare"],
)
def test_files_of_the_working_directory_shadow_no_module(tmp_path: Path, options: tuple[str, ...]) -> None:
    for name in ("plant", "autopilot", "mavlink", "numpy", "signal", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('of the working directory')")
    command = [
        str(Path(sys.executable).parent / "colibri"),
        *options,
        "--profile",
        "flight",
        "--duration",
        "0.1",
        "--quiet",
    ]
    done = subprocess.run([*command, "--out", "out"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "of the working directory" not in done.stdout + done.stderr
    assert (done.returncode, done.stderr) == (0, "")


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
def test_two_flights_into_one_folder_are_refused_the_second_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], command: tuple[str, ...], folder: str
) -> None:
    with FolderLock(tmp_path / folder, "--out"), pytest.raises(SystemExit) as ended:
        main([*command, "--out", str(tmp_path)])
    assert ended.value.code == 2
    in_use = f"--out {tmp_path / folder} is in use by another flight: end that or name another"
    assert capfd.readouterr().err == f"colibri: error: {in_use}\n"
