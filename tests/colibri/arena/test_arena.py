"""`colibri arena`: sets, laws, the worst of all starts, files."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import colibri
from colibri.arena import run
from colibri.arena.flights import Arena, Row
from colibri.arena.run import ArenaResults, laws_of, planned_of
from colibri.campaigns.flights import FlightResult, Verdict, check, common_of
from colibri.common.config import toml_names
from colibri.plant.vehicle.description import vehicle_text
from tests.support.campaigns import Here
from tests.support.commands import Refused
from tests.support.pages import ROOT

SETS = [name for name in toml_names(Path(run.__file__).parent / "sets") if not name.startswith(("rotors-", "foehn-"))]
LAW = """
import numpy as np
import colibri

class Lifts:
    control_interval_us = 10_000
    preview = colibri.Preview(interval_us=10_000, samples=1)
    def __init__(self, table, vehicle, clock):
        self.speeds = np.full(4, vehicle.hover_speed * 1.4)
    def initial(self, rotor_speed):
        return None
    def step(self, memory, time_us, state, references):
        return None, colibri.Decision(self.speeds, state.euler)
"""


SMALL = """
vehicle = "mine.toml"
duration_s = 3
[tracks]
circle = "ramped:curve=circle,acceleration=5,speed={speed}"
[speeds]
circle = [10, 20]
[worlds.calm]
[worlds.heavy]
"plant-vehicle.body.mass_kg*" = 1.1
[[published]]
law = "theirs"
source = "a paper of 2024"
world = "calm"
[published.mean_mm]
circle = [7, 8]
"""


def test_the_race_has_25_cells() -> None:
    race = Arena("race")
    rows = list(race.set.rows())
    assert len(rows) == len(list(Arena("race-told").set.rows())) == 25
    beyond = {(row.track, row.speed_m_s) for row in rows if race.thrust(row) > 1.0}
    wrapped = {("wrapped-circle", 10.0), ("wrapped-lemniscate", 8.0), ("wrapped-lemniscate", 10.0)}
    assert beyond == wrapped | {("tilted-circle", 12.5), ("lemniscate", 12.5), ("wrapped-circle", 12.5)}
    planned = planned_of("race", laws_of(["agile"]), 5)
    assert planned.flights == 125
    first, second = (level.settings["start"] for level in planned.grid["case"][:2])
    assert np.hypot.reduce([first[axis] - second[axis] for axis in "xyz"]) == pytest.approx(1e-3)


@pytest.mark.parametrize("name", SETS)
def test_flights_of_a_set_can_begin(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("colibri.autopilot.guidance.trajectories.time_optimal.fastest._ITERATIONS", 2)
    planned = planned_of(name, laws_of(["se3"]), 1)
    assert check([next(planned.points())], common_of(planned)) == []


def test_a_set_is_flown_with_a_file_of_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from colibri.cli.main import main

    (tmp_path / "own.py").write_text(LAW, encoding="utf-8")
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    (tmp_path / "mine.toml").write_text(vehicle_text("hummingbird"), encoding="utf-8")
    monkeypatch.setattr(run, "engine_of", lambda *_: Here())
    options = ["--law", "se3", "--law", f"{tmp_path}/own.py", "--starts", "1", "--out", str(tmp_path / "out")]
    assert main(["arena", f"{tmp_path}/small.toml", *options]) == 0
    assert "circle" in capsys.readouterr().out
    folder = tmp_path / "out" / "small"
    assert {path.name for path in folder.iterdir()} >= {"arena.md", "arena.png", "flights.csv"}
    with (folder / "arena.csv").open(encoding="utf-8", newline="") as file:
        rows = {(row["law"], row["speed_m_s"], row["world"]): row for row in csv.DictReader(file)}
    assert len(rows) == 8
    assert [rows[law, "10.0", "calm"]["lost"] for law in ("se3", "Lifts")] == ["0", "1"]
    assert float(rows["Lifts", "10.0", "calm"]["mean_mm"]) == 5000.0
    assert float(rows["se3", "10.0", "calm"]["mean_mm"]) < 100.0
    assert json.loads((folder / "arena.json").read_text())["cap_m"] == 5.0
    lines = (folder / "arena.md").read_text(encoding="utf-8").splitlines()
    assert lines[2].endswith("| lost 1 of 1 | 7 |")
    assert "| Lifts | 10 | 0 | 4 of 4 | 5000.0 |" in "".join(lines)


def test_the_worst_start_counts_and_a_lost_one_as_the_cap() -> None:
    planned = planned_of("policy", laws_of(["se3"]), 2)

    def flown(flight: int, verdict: Verdict, mean_m: Any) -> FlightResult:
        return FlightResult(flight, verdict, "", (mean_m, 0.2, 0.3, 10.0, 5.0, None), "")

    flights = [flown(0, Verdict.FLOWN, 0.1), flown(1, Verdict.FLOWN, 0.2), flown(2, Verdict.FLOWN, 0.1)]
    flights.append(flown(3, Verdict.LOST, 0.3))
    cells = ArenaResults(planned, dict(enumerate(flights))).cells
    worst, lost = (cells["se3", Row("hover", 0.0, world)] for world in ("nominal", "mass +20 %"))
    assert (worst.mean_mm, worst.lost, worst.flights) == (200.0, 0, 2)
    assert (lost.mean_mm, lost.largest_mm, lost.lost, str(lost)) == (5000.0, 5000.0, 1, "lost 1 of 2")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["rase"], 'unknown set "rase" (did you mean "race"?)'),
        (["race", "--starts", "9"], 'starts: must be 1 to 7, not "9"'),
        (["race", "--law", "agil"], 'unknown law "agil" (did you mean "agile"?)'),
        (["race", "robust", "--json"], '--json: takes one set, not "race robust"'),
        (["race", "--law", "none.py"], "controller none.py: No such file or directory"),
        (["race", "--law", "agile", "--law", "agile"], 'law: "agile" is given twice'),
    ],
)
def test_what_cannot_be_flown_is_one_line(refused: Refused, words: list[str], line: str) -> None:
    assert refused("arena", *words) == line


@pytest.mark.parametrize("law", ["nmpc"])
def test_laws_of_the_examples_hold_a_point(law: str) -> None:
    start = {"x": 0.3, "z": 2.0}
    flight = colibri.fly("hover", controller=f"{ROOT}/examples/laws/{law}.py", link="direct", duration=3.0, start=start)
    assert flight.lost is None
    assert abs(flight.samples["x"][-1]) < 0.05


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("circle = [10, 20]", "", "tracks.circle: needs both {speed} and speeds.circle, or neither"),
        ("[7, 8]", "[7]", "published: theirs: circle needs a value for each of its speeds, and a world"),
        ("[speeds]", "[speeds]\nround = [3]", 'speeds: unknown track "round" (choose circle)'),
        ('"mine.toml"', "3", "vehicle: Expected `str`, got `int`"),
    ],
)
def test_a_wrong_set_is_one_line(tmp_path: Path, refused: Refused, old: str, new: str, why: str) -> None:
    path = tmp_path / "small.toml"
    path.write_text(SMALL.replace(old, new), encoding="utf-8")
    assert refused("arena", str(path)) == f"{path}: {why}"
