import csv
import json
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.analysis.tables import identifier
from colibri.autopilot.control import loop
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import load_controller
from colibri.campaigns.definition import Point
from colibri.campaigns.engines import Killed, Pool
from colibri.cli.main import main
from colibri.studies.comparison import COLUMNS, contenders_of, folder_name
from colibri.studies.thesis_figures import FIGURES
from tests.support.campaigns import Here, Hovers
from tests.support.commands import Ran, Refused

PROFILE = Path(__file__).parents[2] / "autopilot" / "profiles" / "flight.toml"


def test_every_figure_of_the_thesis_has_its_place() -> None:
    numbers = [figure.number for figure in FIGURES]
    assert numbers == [*(f"4.{i}" for i in range(1, 12)), *(f"A.{i}" for i in range(1, 25))]
    flights = {figure.number: figure.flight for figure in FIGURES}
    firsts = ("4.1", "4.5", "A.1", "A.7", "A.13", "A.19")
    assert [flights[number] for number in firsts] == ["global", "spiral", "expanding-spiral", "line", "wave", "crown"]
    kinds = {figure.number: figure.kind for figure in FIGURES}
    assert (kinds["4.10"], kinds["4.11"], kinds["A.24"]) == ("first-seconds", "inputs", "inputs")


@pytest.mark.long
def test_tracks_with_options_are_compared_too(tmp_path: Path) -> None:
    tracks = ["hover:x=1,y=2", "hover:x=1"]
    options = [option for name in tracks for option in ("--track", name)]
    assert main(["compare", "--profile", "thesis", *options, "--out", str(tmp_path), "--quiet"]) == 0
    with (tmp_path / "compare.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))
    assert [line[:2] for line in lines[1:]] == [["thesis", name] for name in tracks]
    assert {len(line) for line in lines} == {len(COLUMNS)}
    assert {path.name for path in (tmp_path / "flights").iterdir()} == {"thesis-hover-x=1,y=2", "thesis-hover-x=1"}


@pytest.mark.parametrize(
    ("name", "folder"),
    [("spiral", "spiral"), ("waypoints:a/b.csv", "waypoints-a%2Fb.csv"), ("waypoints:../a:b", "waypoints-..%2Fa%3Ab")],
)
def test_a_track_names_a_folder(name: str, folder: str) -> None:
    assert folder_name(name) == folder


@pytest.mark.long
def test_only_what_is_asked_for_is_drawn(tmp_path: Path) -> None:
    assert main(["figures", "--only", "4.9", "--only", "A.7", "--out", str(tmp_path), "--quiet"]) == 0
    drawn = {path.name for path in tmp_path.iterdir() if path.is_file()}
    figures = ("4.9-spiral-angles", "A.7-line-trajectory")
    assert drawn == {f"{figure}.{kind}" for figure in figures for kind in ("png", "svg")}
    width, height = struct.unpack(">II", (tmp_path / "4.9-spiral-angles.png").read_bytes()[16:24])
    assert width >= 900
    assert height >= 600
    assert (tmp_path / "flights" / "spiral" / "flight.csv").exists()


@pytest.mark.long
def test_controllers_side_by_side(tmp_path: Path, ran: Ran) -> None:
    contenders = ["--profile", "thesis", "--profile", "thesis:global-lpv-mpc"]
    said = ran("compare", *contenders, "--track", "line", "--track", "spiral", "--out", tmp_path, code=1).out
    lines = (tmp_path / "compare.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == ",".join(map(identifier, COLUMNS))
    pairs = [[profile, track] for profile in ("thesis", "thesis:global-lpv-mpc") for track in ("line", "spiral")]
    assert [line.split(",")[:2] for line in lines[1:]] == pairs
    assert [line.split(",")[2] for line in lines[1:3]] == ["0.05783", "0.1254"]
    assert float(lines[4].split(",")[2]) > 100.0
    table = (tmp_path / "compare.md").read_text(encoding="utf-8").splitlines()
    assert len(table) == 6
    assert table[2].startswith("| thesis | line | 0.05783 | ")
    assert [line.split(",")[7] != "" for line in lines[1:]] == [False, False, True, True], "the times of the lost ones"
    assert "thesis:global-lpv-mpc, spiral: lost at t = " in said


def written(folder: Path, name: str, old: str = "", new: str = "") -> str:
    folder.mkdir(exist_ok=True)
    path = folder / name
    text = PROFILE.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return str(path)


def test_a_copied_profile_has_a_name_of_its_own(tmp_path: Path) -> None:
    copies = (written(tmp_path, "t2.toml"), written(tmp_path, "flight.toml"))
    assert [load_profile(copy).name for copy in copies] == ["t2", "flight.toml"]
    named = written(tmp_path, "t3.toml", 'name = "flight"', 'name = "mine"')
    assert list(contenders_of(["flight", *copies, named, f"{copies[0]}:geometric-se3", copies[0]])) == [
        *("flight", "t2", "flight.toml", "mine", "t2:geometric-se3")
    ]
    twin = written(tmp_path / "b", "t2.toml")
    assert list(contenders_of([copies[0], twin, named])) == [copies[0], twin, "mine"]
    assert contenders_of(["se3", "thesis:cascade"], ["lpv-mpc", "geometric-se3"]) == {
        "se3:lpv-mpc": {"profile": "se3", "controller": "lpv-mpc"},
        "se3:geometric-se3": {"profile": "se3", "controller": "geometric-se3"},
        "thesis:cascade": {"profile": "thesis", "controller": "cascade"},
    }


def test_a_profile_given_by_path_flies_under_its_name(
    tmp_path: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By options of `colibri fly` that change neither the table nor its columns; again only what has changed."""
    monkeypatch.setattr(Pool, "each", Here().each)
    copy, out = written(tmp_path / "p", "t2.toml"), tmp_path / "out"
    options = ["--track", "hover", "--duration", "0.5", "--wind", "2@270", "--without", "drag", "--start", "z=3"]
    command = ["compare", "--profile", copy, *options, "--out", str(out)]
    assert main(command) == 0
    assert [path.name for path in (tmp_path / "p").iterdir()] == ["t2.toml"]
    folder = out / "flights" / "t2-hover"
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert (report["profile"], report["without"], report["start"]["z"]) == ("t2", ["drag"], 3.0)
    (row,) = csv.DictReader((out / "compare.csv").read_text(encoding="utf-8").splitlines())
    assert tuple(row) == tuple(map(identifier, COLUMNS))
    assert all(name.isidentifier() for name in row)
    assert (row["controller"], row["rms_m"], row["why"]) == ("t2", "-", "")
    flown = (folder / "flight.csv").stat().st_mtime_ns
    said = ran(*command, "--resume").out
    assert said.startswith("--resume: 1 of 1 flights were flown already, by the same contents\n")
    assert max(map(len, said.splitlines()[2:])) <= 80, "as wide as a terminal"
    assert (folder / "flight.csv").stat().st_mtime_ns == flown
    written(tmp_path / "p", "t2.toml", "poles = [-5.0, -6.0]", "poles = [-1.0, -1.1]")
    assert main([*command, "--resume"]) == 0
    assert (folder / "flight.csv").stat().st_mtime_ns > flown
    assert json.loads((folder / "provenance.json").read_text(encoding="utf-8"))["profile"]["name"] == "t2"


class Raises(Hovers):
    def step(self, memory: None, time_us: int, state: colibri.VehicleState, references: object) -> Any:
        if time_us == 200_000:
            raise KeyError("gain")
        return super().step(memory, time_us, state, references)


def test_a_comparison_goes_on_after_a_lost_flight_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran
) -> None:
    monkeypatch.setattr(Pool, "each", Here().each)
    laws = {"geometric-se3": Raises, "lpv-mpc": load_controller("lpv-mpc")}
    monkeypatch.setattr(loop, "load_controller", laws.__getitem__)
    options = ["--profile", "flight:geometric-se3", "--profile", "flight", "--track", "hover", "--duration", "0.5"]
    said = ran("compare", *options, "--out", tmp_path, code=1).out
    lost, fine = csv.DictReader((tmp_path / "compare.csv").read_text(encoding="utf-8").splitlines())
    why = "controller geometric-se3 raised at t = 0.200 s: KeyError: 'gain'; its traceback is in "
    assert lost["why"].startswith(why)
    assert "in step" in Path(lost["why"].removeprefix(why)).read_text(encoding="utf-8")
    assert fine["why"] == ""
    assert f"flight:geometric-se3, hover: lost at t = 0.20 s: {why}" in said


def test_a_flight_that_kills_its_process_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran) -> None:
    def kills(_pool: Pool, work: Any, common: Any, jobs: Iterable[Point]) -> Iterator[tuple[Point, Any]]:
        for job in jobs:
            yield job, Killed() if job.settings["profile"] == "se3" else work(common, job)

    monkeypatch.setattr(Pool, "each", kills)
    command = ["compare", "--profile", "se3", "--profile", "flight", "--track", "hover", "--duration", "0.5"]
    assert main([*command, "--out", str(tmp_path)]) == 1
    lost, fine = csv.reader((tmp_path / "compare.csv").read_text(encoding="utf-8").splitlines()[1:])
    assert lost[:8] == ["se3", "hover", *["-"] * 5, "0"]
    assert lost[8] == "the process that flew it was killed, and again when it flew this alone"
    assert fine[7:] == ["", ""]
    monkeypatch.setattr(Pool, "each", Here().each)
    said = ran(*command, "--out", tmp_path, "--resume").out
    assert "--resume: 1 of 2 flights were flown already, by the same contents\n" in said


def test_a_law_that_cannot_be_built_is_found_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    laws = {"geometric-se3": lambda *_: dict[str, object]()["gain"], "lpv-mpc": load_controller("lpv-mpc")}
    monkeypatch.setattr(loop, "load_controller", laws.__getitem__)
    options = ["--profile", "flight", "--profile", "flight:geometric-se3", "--track", "hover", "--duration", "0.5"]
    said = refused("compare", *options, "--out", tmp_path / "out")
    assert said == "controller geometric-se3 cannot be built: KeyError: 'gain'"
    assert not (tmp_path / "out" / "flights").exists()
