"""`colibri figures` and `colibri compare`."""

import csv
import struct
from pathlib import Path

import pytest

from colibri.autopilot.guidance.trajectories.tracks import OPTIONS, THESIS_TRACKS
from colibri.cli.main import main
from colibri.studies.compare import COLUMNS, folder_name
from colibri.studies.thesis_figures import FIGURES

INSTALLED = "cascade, geometric-se3, global-lpv-mpc, lpv-mpc"


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
    assert drawn == {
        "4.9-spiral-angles.png",
        "4.9-spiral-angles.svg",
        "A.7-line-trajectory.png",
        "A.7-line-trajectory.svg",
    }
    width, height = struct.unpack(">II", (tmp_path / "4.9-spiral-angles.png").read_bytes()[16:24])
    assert width >= 900
    assert height >= 600
    assert (tmp_path / "flights" / "spiral" / "flight.csv").exists()


def test_an_unknown_figure_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["figures", "--only", "5.1", "--out", str(tmp_path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "colibri: error: there is no figure 5.1: choose 4.1 to 4.11 or A.1 to A.24\n"


def test_controllers_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    contenders = ["--profile", "thesis", "--profile", "thesis:global-lpv-mpc"]
    assert main(["compare", *contenders, "--track", "line", "--track", "spiral", "--out", str(tmp_path)]) == 0
    lines = (tmp_path / "compare.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert [line.split(",")[:2] for line in lines[1:]] == [
        ["thesis", "line"],
        ["thesis", "spiral"],
        ["thesis:global-lpv-mpc", "line"],
        ["thesis:global-lpv-mpc", "spiral"],
    ]
    assert [line.split(",")[2] for line in lines[1:3]] == ["0.05783", "0.1254"]
    assert float(lines[4].split(",")[2]) > 100.0
    table = (tmp_path / "compare.md").read_text(encoding="utf-8").splitlines()
    assert len(table) == 6
    assert table[2].startswith("| thesis | line | 0.05783 | ")
    assert "global-lpv-mpc" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["--profile", "fast"], "unknown profile fast: choose flight, se3, thesis, thesis-euler or a .toml file"),
        (["--profile", "thesis:pid"], f"unknown controller pid: installed are {INSTALLED}"),
        (["--track", "loop"], f"unknown track loop: choose {', '.join([*THESIS_TRACKS, *OPTIONS])}"),
    ],
)
def test_bad_contenders_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], line: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["compare", *options, "--out", str(tmp_path)])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"colibri: error: {line}\n"
