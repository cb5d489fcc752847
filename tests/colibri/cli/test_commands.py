import json
import os
import resource
import shlex
import subprocess
import sys
from contextlib import redirect_stdout
from errno import ENOSPC
from importlib.metadata import version
from pathlib import Path

import pytest

from colibri.cli.commands import COMMANDS, PROCESSES, parser_of
from colibri.cli.main import main
from colibri.cli.options import SHELLS
from colibri.flights.provenance import plan_of
from tests.support.commands import FLIGHT, VEHICLE, Ran, Refused, edited, exit_code

FIGURES = ("trajectory", "position", "attitude", "inputs", "rotors", "error")
MAX_HELP_S = 0.2  # of a core, startup of Python included
HELP = """
import sys
from colibri.cli.options import SHELLS
from colibri.cli.main import main
try:
    main(["--help"])
finally:
    print(*sys.modules, file=sys.stderr)
"""


def test_help_names_every_command_and_loads_little() -> None:
    took_s = []
    for _ in range(5):
        before_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=True)
        took_s.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before_s)
    for command in (*COMMANDS, *PROCESSES):
        assert f"\n  {command} " in done.stdout
    assert not {"numpy", "numba", "msgspec", "pymavlink", "rich"} & set(done.stderr.split())
    assert min(took_s) < MAX_HELP_S


@pytest.mark.parametrize("command", COMMANDS)
def test_every_example_of_the_help_is_a_command(command: str) -> None:
    examples = [line.partition("#")[0].partition(">")[0] for line in COMMANDS[command].examples.split("\n")]
    given = [shlex.split(example) for example in examples if example.strip()]
    assert given
    for program, name, *options in given:
        assert (program, name) == ("colibri", command)
        parser_of(command).parse_args([name, *options])
    assert callable(COMMANDS[command].load())


def test_help_fits_a_narrow_terminal(ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for command in COMMANDS:
        said = ran(command, "--help").out
        assert said.startswith(f"usage: colibri {command} ")
        assert "\nexamples:\n  colibri " in said
        assert max(map(len, said.splitlines())) <= 80


@pytest.mark.parametrize("shell", SHELLS)
def test_shells_complete_commands_and_their_options(shell: str, ran: Ran) -> None:
    script = ran("completion", shell).out
    assert "check-controller" in script
    assert "turbulence" in script


COMPLETE = r"""
source "$1"
shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*" COMP_POINT=${#COMP_LINE}
_shtab_colibri colibri "${COMP_WORDS[-1]}" "${COMP_WORDS[-2]}"
printf '%s\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def bash_script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    script = tmp_path_factory.mktemp("completion") / "colibri"
    with script.open("w", encoding="utf-8") as file, redirect_stdout(file):
        assert exit_code(["completion", "bash"]) == 0
    return script


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("check-c", {"check-controller"}),
        ("fly sp", {"spiral"}),
        ("fly --profile th", {"thesis", "thesis-euler"}),
        ("fly --feedback s", {"state", "sensors"}),
        ("sitl --vehicle hummingbird-t", {"hummingbird-thesis"}),
        ("check-controller geo", {"geometric-se3"}),
        ("show profile se", {"se3"}),
        ("plant --realt", {"--realtime"}),
        ("plot flown", {"flown"}),
        ("export flown.u", {"flown.ulg"}),
        ("view flown", {"flown", "flown.ulg"}),
        ("fly --out flown", {"flown"}),
    ],
)
def test_bash_completes_names_files_and_folders(
    words: str, completed: set[str], bash_script: Path, tmp_path: Path
) -> None:
    (tmp_path / "flown").mkdir()
    (tmp_path / "flown.ulg").touch()
    command = ["bash", "-c", COMPLETE, "bash", str(bash_script), "colibri", *words.split()]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == completed


@pytest.mark.parametrize("package", ["plant", "autopilot"])
def test_help_says_what_a_stranger_needs(package: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", f"colibri.{package}", "--help"], capture_output=True, text=True, check=True
    )
    assert f"Example: colibri {package}" in done.stdout
    assert "14560" in done.stdout


def test_the_version_is_printed(ran: Ran) -> None:
    assert ran("--version").out == f"colibri {version('colibri-sitl')}\n"


@pytest.mark.parametrize(("what", "file"), [("profile", FLIGHT), ("vehicle", VEHICLE)])
def test_a_file_of_colibris_own_is_shown_to_be_copied(what: str, file: Path, ran: Ran) -> None:
    assert ran("show", what, file.stem).out == file.read_text(encoding="utf-8")


@pytest.mark.parametrize("whom", ["px4", "ardupilot"])
def test_a_vehicle_is_written_as_parameters_of_another_autopilot(whom: str, tmp_path: Path, ran: Ran) -> None:
    printed = ran("vehicle", "hummingbird", "--for", whom).out
    assert printed.startswith(f"# AscTec Hummingbird, by colibri vehicle hummingbird --for {whom}\n")
    out = tmp_path / "new" / "vehicle.params"
    heavier = edited(tmp_path, VEHICLE, "mass_kg = 0.698", "mass_kg = 0.8")
    assert ran("vehicle", heavier, "--for", whom, "--out", out).out == ""
    written = out.read_text(encoding="utf-8")
    assert written.splitlines()[0].endswith(f" --for {whom}")
    pairs = zip(printed.splitlines()[1:], written.splitlines()[1:], strict=True)
    (changed,) = (before for before, after in pairs if before != after)
    assert "_HOVER" in changed


def test_figures_are_drawn_of_what_a_flight_left(tmp_path: Path, ran: Ran, refused: Refused) -> None:
    """By what is in its folder alone: neither its profile nor its waypoints are there any more."""
    profile, points = edited(tmp_path, FLIGHT, 'name = "flight"', 'name = "mine"'), tmp_path / "points.csv"
    points.write_text("x,y,z\n0,0,1\n2,0,2\n", encoding="utf-8")
    out = tmp_path / "out"
    options = ("--profile", profile, "--link", "memory", "--duration", "0.5", "--wind", "2@270", "--no-figures")
    ran("fly", f"waypoints:{points}", *options, "--quiet", "--out", out)
    Path(profile).unlink()
    points.unlink()
    (out / "report.json").unlink()
    drawn = ran("plot", out).out.split()
    assert drawn == [str(out / f"{name}.png") for name in FIGURES]
    for path in drawn:
        content = Path(path).read_bytes()
        assert content.startswith(b"\x89PNG\r\n\x1a\n")
        assert len(content) > 10_000
        assert int.from_bytes(content[16:20], "big") >= 900  # wide enough to read
    assert "provenance.json is missing" in refused("plot", tmp_path)


@pytest.mark.long
def test_figures_that_find_no_room_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran, refused: Refused
) -> None:
    def full(*_: object) -> None:
        raise OSError(ENOSPC, os.strerror(ENOSPC))

    ran("fly", "hover", "--link", "memory", "--duration", "0.1", "--quiet", "--out", tmp_path)
    monkeypatch.setattr("colibri.analysis.figures.draw_flight", full)
    assert refused("plot", tmp_path) == f"{tmp_path}: No space left on device"


@pytest.mark.long
def test_figures_of_either_process_fail_in_one_line(tmp_path: Path, ran: Ran) -> None:
    ran("fly", "hover", "--link", "memory", "--duration", "0.1", "--no-figures", "--quiet", "--out", tmp_path)
    for name in ("position", "attitude"):
        (tmp_path / f"{name}.png").unlink(missing_ok=True)
        (tmp_path / f"{name}.png").mkdir()
        plot = [sys.executable, "-m", "colibri", "plot", str(tmp_path)]
        done = subprocess.run(plot, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (2, f"colibri: error: {tmp_path}/{name}.png: Is a directory\n")


def test_titles_name_a_law_that_is_not_the_profiles(tmp_path: Path, ran: Ran) -> None:
    options = ("--link", "memory", "--duration", "0.1", "--no-figures", "--out", tmp_path)
    said = ran("fly", "hover", "--controller", "geometric-se3", *options).out
    assert said.startswith("hover, profile flight, controller geometric-se3")
    assert plan_of(tmp_path).flown_by == "profile flight, controller geometric-se3"


def test_a_flight_leaves_what_the_readme_names(tmp_path: Path) -> None:
    assert main(["fly", "crown", "--duration", "21", "--seed", "7", "--quiet", "--out", str(tmp_path)]) == 0
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert {"track": "crown", "profile": "flight", "link": "udp", "seed": 7, "solver": "daqp"}.items() <= report.items()
    assert set(report["solve_time_us"]) == set(report["control_step_us"]) == {"p50", "p99", "max"}
    assert report["sim_time_s"] == 21.0
    assert report["real_time_factor"] == pytest.approx(21.0 / report["wall_time_s"])
    assert 0.0 < report["rmse_after_20s_m"] <= report["rmse_m"] <= report["max_error_m"]
    assert len(report["trajectory_sha256"]) == 64
    assert {"flight.csv", "flight.ulg"} <= {path.name for path in tmp_path.iterdir()}
    assert len(list(tmp_path.glob("*.png"))) == 6


def test_a_new_vehicle_is_written_and_not_overwritten(tmp_path: Path, ran: Ran, refused: Refused) -> None:
    out = tmp_path / "mine.toml"
    options = ("--mass", 2.06, "--wheelbase", 0.5, "--propeller", "10x4.5", "--hover-throttle", 0.5, "--out", out)
    said = ran("vehicle", "new", "mine", *options).out
    assert said.startswith(f"wrote {out}: thrust 40.4 N, 2.00 times the weight; ")
    assert "\nnot measured: thrust, rotor lag, inertia, drag\n" in said
    assert refused("vehicle", "new", "mine", *options).endswith("or --force to overwrite it")
    ran("vehicle", "new", "mine", *options, "--force")
    assert ran("vehicle", out, "--for", "px4").out.startswith("# mine, by")
    assert refused("vehicle", "new", "mine") == ("required: --mass KG, --arm M or --wheelbase M, --propeller SIZE")
    assert refused("vehicle", "new").endswith("a name is required")
    assert refused("vehicle", out, "--for", "px4", "--mass", 3) == "--mass is an option of vehicle new NAME"
    assert refused("vehicle", "hummingbird").startswith("--for px4 or ardupilot is required")
    log = tmp_path / "flight.ulg"
    assert refused("vehicle", "new", "other", *options, "--from-log", log) == f"{log}: No such file or directory"


def test_a_plant_with_another_rotor_order_is_refused(tmp_path: Path, ran: Ran, refused: Refused) -> None:
    options = ("--mass", 2.06, "--arm", 0.25, "--propeller", "10x4.5", "--hover-throttle", 0.5)
    for order in ("px4", "clockwise"):
        ran("vehicle", "new", order, *options, "--order", order, "--out", tmp_path / f"{order}.toml")
    plant = ("--plant-vehicle", tmp_path / "px4.toml")
    fly = ("fly", "hover", "--vehicle", tmp_path / "clockwise.toml", *plant, "--link", "memory")
    assert "in another order" in refused(*fly, "--out", tmp_path / "out")
