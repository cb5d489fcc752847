import re
from collections.abc import Sequence
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colibri.analysis.recording import COLUMNS
from colibri.campaigns.engines import Pool
from colibri.campaigns.flights import common_of, plan_point
from colibri.cli.main import main
from colibri.flights.plan import FlightPlan
from colibri.plant.vehicle.description import load_vehicle
from colibri.studies.studies import FORMATS, STUDIES, Measure, Settings, Study, StudyCase, campaign, table, write
from colibri.studies.study_figures import Flown, fly
from tests.support.campaigns import Here
from tests.support.commands import Ran

SHORT: Settings = {"track": "hover:height=20", "start": {"z": 20.0, "phi": 170.0}, "duration": 0.8}
NAMES = [study.name for study in STUDIES]


@pytest.fixture(scope="module")
def short() -> Flown:
    planned = campaign([SHORT])
    return fly(common_of(planned), next(planned.points()))


def plans(flights: Sequence[Settings]) -> list[FlightPlan]:
    planned = campaign(flights)
    common = common_of(planned)
    return [plan_point(common, point) for point in planned.points()]


def plan_of(**settings: Any) -> FlightPlan:
    (plan,) = plans([settings])
    return plan


def moved(flown: Flown, *, to_t_s: float, by_m: float) -> Flown:
    """Return a flight whose samples end at another time, `by_m` further from the reference."""
    recording = flown.recording
    changed = recording.table.copy()
    changed[:, COLUMNS.index("t")] += to_t_s - changed[-1, 0]
    changed[:, COLUMNS.index("x")] += by_m
    return replace(flown, recording=replace(recording, table=changed))


def of_name(name: str) -> Study:
    (found,) = [study for study in STUDIES if study.name == name]
    return found


@pytest.mark.parametrize("name", NAMES)
def test_every_case_has_a_cell_of_its_own_and_can_be_flown(name: str) -> None:
    cases = of_name(name).cases
    assert len({(case.row, case.group) for case in cases}) == len(cases)
    assert len({case.row for case in cases}) * len({case.group for case in cases}) == len(cases)
    flights = [case.flight for case in cases]
    for flight, plan in zip(flights, plans(flights), strict=True):
        assert plan.spec.duration == flight.get("duration", 100.0)
        assert plan.spec.track == flight["track"]


def case(study: str, row: tuple[str, ...], group: str) -> Settings:
    (found,) = [each.flight for each in of_name(study).cases if (each.row, each.group) == (row, group)]
    return found


def test_a_flight_changes_what_it_says_and_nothing_else() -> None:
    start = plan_of(**case("recovery", ("inverted", "φ = 170°"), "")).start
    assert start == plan_of(track="hover:height=20").start._replace(y=0.0, z=20.0, phi=170.0)
    windy = plan_of(**case("robustness", ("spiral", "wind 5 m/s"), "LPV-MPC"))
    assert str(windy.spec.wind) == "5.0@270.0"
    assert windy.plant_vehicle == windy.vehicle
    assert windy.spec.link == "memory"


def test_a_perturbation_is_the_plants_alone() -> None:
    nominal = load_vehicle("hummingbird")
    row = ("spiral", "wind, mass +20 %, inertia +30 %, weak rotor")
    plan = plan_of(**case("robustness", row, "LPV-MPC"))
    assert plan.vehicle == nominal
    assert plan.plant_vehicle.body.mass_kg == pytest.approx(1.2 * nominal.body.mass_kg)
    assert plan.plant_vehicle.body.inertia_kg_m2 == pytest.approx([1.3 * i for i in nominal.body.inertia_kg_m2])
    assert plan.plant_vehicle.rotors.strength == (0.85, 1.0, 1.0, 1.0)
    assert plan.plant_vehicle.ground is None


def test_a_limit_is_both_sides() -> None:
    plan = plan_of(**case("limits", ("spiral", "600", "without"), ""))
    assert plan.vehicle.rotors.max_speed == plan.plant_vehicle.rotors.max_speed == 600.0
    assert plan.vehicle.battery is plan.plant_vehicle.battery is None


def test_figures_of_merit(short: Flown) -> None:
    assert short.failure == ""
    assert isnan(short.rms_m)
    assert not short.lost
    assert short.tilt_deg[0] == pytest.approx(170.0)
    assert short.height_lost_m > 0.1
    late = moved(short, to_t_s=30.0, by_m=1.0)
    error = late.recording.position_error_m
    assert late.rms_m == pytest.approx(np.sqrt(np.mean(error**2)))
    assert late.max_error_m == error.max()


def test_far_off_is_lost(short: Flown) -> None:
    assert moved(short, to_t_s=30.0, by_m=100.0).lost
    assert not moved(short, to_t_s=10.0, by_m=100.0).lost  # may still be on its way
    assert replace(short, failure="the state is not finite").lost


def test_the_time_from_which_a_bound_holds(short: Flown) -> None:
    ramp = np.linspace(10.0, 0.0, len(short.t))
    since_s = short.stays_below(ramp, 5.0)
    assert since_s == short.t[np.argmax(ramp < 5.0)]
    assert isnan(short.stays_below(ramp, -1.0))
    assert short.stays_below(ramp, 11.0) == 0.0


def test_a_table_has_rows_of_names_and_columns_of_groups(short: Flown) -> None:
    measures = (Measure("one", lambda _flown: "1"), Measure("two", lambda flown: flown.failure or ""))
    cases = tuple(StudyCase((row,), group, {"track": row + group}) for row in "ab" for group in ("g", "h"))
    flown = [replace(short, failure=case.flight["track"]) for case in cases]
    headings, rows = table(Study("", ("name",), measures, cases, lambda _results: {}), flown)
    assert headings == ("name", "g: one", "g: two", "h: one", "h: two")
    assert rows == [("a", "1", "ag", "1", "ah"), ("b", "1", "bg", "1", "bh")]


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_figures_and_tables_are_written(name: str, short: Flown, tmp_path: Path) -> None:
    study = of_name(name)
    flown = [moved(short, to_t_s=30.0, by_m=0.1)] * len(study.cases)
    flown[0] = replace(flown[0], failure="lost")
    written = {path.name for path in write(study, flown, tmp_path)}
    figures = written - {f"{name}.md", f"{name}.csv"}
    of_all = {"limits": "limits-spiral-600-with", "recovery": "recovery-inverted"}
    assert of_all.get(name, name) in {Path(figure).stem for figure in figures}
    assert figures == {f"{Path(figure).stem}.{suffix}" for figure in figures for suffix in FORMATS}
    assert {path.name for path in tmp_path.iterdir()} == written
    assert len((tmp_path / f"{name}.md").read_text(encoding="utf-8").splitlines()) == 2 + len(
        {case.row for case in study.cases}
    )


def test_what_is_lost_says_so(short: Flown) -> None:
    study = of_name("tracks")
    lost = moved(short, to_t_s=30.0, by_m=100.0)
    _, rows = table(study, [lost] * len(study.cases))
    assert {cell for row in rows for cell in row[1:]} == {"lost"}


_LEVEL: Settings = {"track": "hover:height=20", "start": {"x": 0.0, "y": 0.0, "z": 20.0, "r": 10.0}, "duration": 0.4}
"""Its height changes by a hundredth of a millimetre."""


@pytest.mark.long
def test_a_study_from_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ran: Ran) -> None:
    flown = {"6": {"track": "lemniscate:lap=6", "duration": 0.4}, "level": _LEVEL}
    cases = tuple(StudyCase((name, ""), "", flight) for name, flight in flown.items())
    brief = of_name("recovery")._replace(cases=cases)
    monkeypatch.setattr("colibri.studies.studies.STUDIES", (brief,))
    said = ran("study", "recovery", "--out", tmp_path).out
    assert "recovery: recovery.md, recovery.csv, recovery.png" in " ".join(said.split())
    assert (tmp_path / "recovery-6.svg").exists()
    level = (tmp_path / "recovery-level.svg").read_text(encoding="utf-8")
    assert "<!-- 20.000 -->" in level
    assert not re.search(r"<!-- .*[+]", level), "an offset of the axis"
    lines = (tmp_path / "recovery.csv").read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[0] for line in lines] == ["start", *flown]


@pytest.mark.long
def test_a_flight_of_two_studies_is_flown_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[object] = []

    def counted(_pool: Pool, work: Any, common: Any, jobs: Any) -> Any:
        for each in Here().each(work, common, jobs):
            done.append(each)
            yield each

    cases = tuple(StudyCase((name, ""), "", _LEVEL) for name in ("one", "two"))
    brief = of_name("recovery")._replace(cases=cases)
    monkeypatch.setattr("colibri.studies.studies.STUDIES", (brief, brief._replace(name="again")))
    monkeypatch.setattr(Pool, "each", counted)
    assert main(["study", "--quiet", "--out", str(tmp_path)]) == 0
    assert len(done) == 1
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "recovery.csv").read_bytes()
