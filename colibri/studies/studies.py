"""`colibri study`: tables and figures of profile `flight`."""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import isnan, pi, sqrt
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from matplotlib.figure import Figure
from rich.console import Console

from colibri.analysis.figures import write_figure
from colibri.analysis.tables import Row, write_table
from colibri.autopilot.control.interface import Fallback
from colibri.autopilot.guidance.trajectories.tracks import THESIS_TRACKS
from colibri.campaigns.definition import Campaign, CampaignTables, campaign_of
from colibri.campaigns.engines import in_order
from colibri.campaigns.flights import common_of
from colibri.common.process.arguments import chosen
from colibri.flights.folder import make_folder
from colibri.plant.vehicle.description import load_vehicle
from colibri.studies import study_figures
from colibri.studies.study_figures import Flown, StudyResult, fly

FORMATS = ("png", "svg")
LPV_MPC, ON_PATH, SE3, THESIS = "LPV-MPC", "LPV-MPC on the path", "SE(3)", "thesis"
Settings: TypeAlias = Mapping[str, Any]
"""Options and keys of one flight, as in a campaign."""
_LAWS: dict[str, Settings] = {
    THESIS: {"profile": "thesis"},
    SE3: {"controller": "geometric-se3"},
    LPV_MPC: {"controller": "lpv-mpc"},
}
_ON_PATH: Settings = {"profile": "path"}
_NO_BATTERY: Settings = {"vehicle": load_vehicle("hummingbird").without(["battery"])}
SPIRAL, LEMNISCATE = "spiral", "lemniscate"

_LEVEL_DEG = 10.0
_THERE_M = 0.1
_SIZE_M = 4.0  # default size of the lemniscate


class Measure(NamedTuple):
    heading: str
    cell: Callable[[Flown], str]


class StudyCase(NamedTuple):
    """A flight, its row, and its group of columns."""

    row: Row
    group: str
    flight: Settings


class Study(NamedTuple):
    """Cases, measures of each group, and a function to named figures."""

    name: str
    headings: Row
    measures: tuple[Measure, ...]
    cases: tuple[StudyCase, ...]
    draw: Callable[[Sequence[StudyResult]], dict[str, Figure]]


def number(value: float) -> str:
    return "-" if isnan(value) else f"{value:.3g}"


def unless_lost(of: Callable[[Flown], float]) -> Callable[[Flown], str]:
    return lambda flown: "lost" if flown.lost else number(of(flown))


def unless_crashed(of: Callable[[Flown], float]) -> Callable[[Flown], str]:
    return lambda flown: "crashed" if flown.crashed else number(of(flown))


def bound(column: int) -> Callable[[Flown], str]:
    """Return how often, %, a kind of constraint is active once settled."""

    def cell(flown: Flown) -> str:
        binds = flown.recording.active[flown.settled[:-1], column] > 0
        return f"{100.0 * binds.mean():.1f}" if len(binds) else "-"

    return cell


RMS = Measure("RMS (m)", unless_lost(lambda flown: flown.rms_m))
MAX_ERROR = Measure("maximum (m)", unless_lost(lambda flown: flown.max_error_m))


def _tracks() -> Iterable[StudyCase]:
    for track in (*THESIS_TRACKS, LEMNISCATE):
        for group, law in _LAWS.items():
            yield StudyCase((track,), group, {**law, "track": track})


_BATTERY: dict[str, Settings] = {"with": {}, "without": _NO_BATTERY}


def _speed() -> Iterable[StudyCase]:
    # Height keeps a saturated vehicle off the ground; the start is on the track at its speed, so that it has no effect.
    # In its middle the lemniscate is straight and fastest, along both axes alike.
    for lap_s in (9.0, 7.5, 6.0, 5.5, 5.0, 4.5, 4.25, 4.0, 3.75, 3.5, 3.0, 2.5, 2.0):
        along_m_s = _SIZE_M * 2.0 * pi / lap_s
        track = f"lemniscate:lap={lap_s:g},height=20"
        start = {"y": 0.0, "z": 20.0, "vx": along_m_s, "vy": along_m_s}
        for group, law in (_LAWS | {ON_PATH: _ON_PATH}).items():
            for battery, vehicle in _BATTERY.items():
                flight = {**law, "track": track, "start": start, **({} if group is THESIS else vehicle)}
                yield StudyCase((f"{lap_s:g}", f"{sqrt(2.0) * along_m_s:.2f}", battery), group, flight)


_STARTS: dict[str, dict[str, float]] = {
    "inverted": {"phi": 170.0},
    "rolling": {"p": 10.0},
    "pitching": {"q": 10.0},
    "spinning": {"r": 10.0},
    "tumbling": {"p": 6.0, "q": 6.0, "r": 5.0},
    "inverted-tumbling": {"phi": 170.0, "p": 6.0, "q": 6.0, "r": 5.0},
}


def _recovery() -> Iterable[StudyCase]:
    for name, values in _STARTS.items():
        texts = (f"φ = {value:g}°" if key == "phi" else f"{key} = {value:g} rad/s" for key, value in values.items())
        row = (name, ", ".join(texts))
        flight = {"track": "hover:height=20", "start": {"y": 0.0, "z": 20.0, **values}, "duration": 20.0}
        yield StudyCase(row, "", {**_LAWS[LPV_MPC], **flight})


def _plant(mass: float = 1.0, inertia: float = 1.0, front_rotor: float = 1.0) -> Settings:
    """Return a plant that differs by factors; a lighter body needs another ground, so it has none."""
    return {
        "plant-vehicle.body.mass_kg*": mass,
        "plant-vehicle.body.inertia_kg_m2*": inertia,
        "plant-vehicle.rotors.strength.0*": front_rotor,
        "without": ["ground"],
    }


_WIND: Settings = {"wind": "5@270"}
_UPSETS: dict[str, Settings] = {
    "nominal": {},
    "wind 5 m/s": _WIND,
    "mass +20 %": _plant(mass=1.2),
    "mass −20 %": _plant(mass=0.8),
    "inertia +30 %": _plant(inertia=1.3),
    "inertia −30 %": _plant(inertia=0.7),
    "one rotor 15 % weak": _plant(front_rotor=0.85),
    "wind, mass +20 %, inertia +30 %, weak rotor": {**_plant(1.2, 1.3, 0.85), **_WIND},
}


def _robustness() -> Iterable[StudyCase]:
    for upset, settings in _UPSETS.items():
        for track in (SPIRAL, LEMNISCATE):
            for group in (SE3, LPV_MPC):
                yield StudyCase((track, upset), group, {**_LAWS[group], **settings, "track": track, "duration": 60.0})


def _limits() -> Iterable[StudyCase]:
    slow = (600.0, (SPIRAL, LEMNISCATE, "lemniscate:lap=5"))
    for max_speed, tracks in ((838.0, (SPIRAL, "lemniscate:lap=5")), slow):
        for track in tracks:
            flight = {**_LAWS[LPV_MPC], "track": track, "vehicle.rotors.max_speed": max_speed, "duration": 40.0}
            for battery, vehicle in _BATTERY.items():
                yield StudyCase((track, f"{max_speed:g}", battery), "", {**flight, **vehicle})


_BINDING = tuple(
    Measure(f"{kind} bind (%)", bound(column))
    for column, kind in enumerate(("rotors", "increments", "angles", "rates"))
)

STUDIES = (
    Study("tracks", ("track",), (RMS, MAX_ERROR), tuple(_tracks()), study_figures.tracks),
    Study(
        "speed",
        ("lap (s)", "top speed (m/s)", "battery"),
        (
            Measure("RMS (m)", unless_crashed(lambda flown: flown.rms_m)),
            Measure("maximum (m)", unless_crashed(lambda flown: flown.max_error_m)),
        ),
        tuple(_speed()),
        study_figures.speed,
    ),
    Study(
        "recovery",
        ("start", "turned, turning"),
        (
            Measure("height lost (m)", unless_crashed(lambda flown: flown.height_lost_m)),
            Measure("tilt < 10° for good (s)", lambda flown: number(flown.stays_below(flown.tilt_deg, _LEVEL_DEG))),
            Measure(
                "error < 0.1 m for good (s)",
                lambda flown: number(flown.stays_below(flown.recording.position_error_m, _THERE_M)),
            ),
            Measure("samples by recovery", lambda flown: str(int(flown.decided_by(Fallback.RECOVERY).sum()))),
        ),
        tuple(_recovery()),
        study_figures.recovery,
    ),
    Study("robustness", ("track", "plant"), (RMS, MAX_ERROR), tuple(_robustness()), study_figures.robustness),
    Study(
        "limits",
        ("track", "largest rotor speed (rad/s)", "battery"),
        (RMS, MAX_ERROR, *_BINDING),
        tuple(_limits()),
        study_figures.limits,
    ),
)


def study(args: argparse.Namespace) -> int:
    wanted = chosen("study", args.names, {study.name: study for study in STUDIES})
    make_folder(args.out)
    flights: list[Settings] = []
    for case in (case for study in wanted for case in study.cases):
        if case.flight not in flights:
            flights.append(case.flight)
    planned = campaign(flights)
    flown = in_order(partial(fly, common_of(planned)), list(planned.points()), "flights", quiet=args.quiet)
    for one in wanted:
        written = write(one, [flown[flights.index(case.flight)] for case in one.cases], args.out)
        if not args.quiet:
            Console().print(f"{one.name}: {', '.join(path.name for path in written)} in {written[0].parent}")
    return 0


def campaign(flights: Sequence[Settings]) -> Campaign:
    levels = {str(number): flight for number, flight in enumerate(flights)}
    return campaign_of(CampaignTables(name="study", grid={"case": levels}))


def write(study: Study, flown: Sequence[Flown], out: Path) -> list[Path]:
    paths = write_table(out / study.name, *table(study, flown), names=len(study.headings))
    results = [StudyResult(case.row, case.group, result) for case, result in zip(study.cases, flown, strict=True)]
    for name, figure in study.draw(results).items():
        paths += write_figure(figure, out / name, FORMATS)
    return paths


def table(study: Study, flown: Sequence[Flown]) -> tuple[Row, list[Row]]:
    """Return headings and rows, one for each name."""
    groups = list(dict.fromkeys(case.group for case in study.cases))
    headings = [f"{group}: {measure.heading}".removeprefix(": ") for group in groups for measure in study.measures]
    cells = {
        (case.row, case.group): [measure.cell(result) for measure in study.measures]
        for case, result in zip(study.cases, flown, strict=True)
    }
    rows = [
        (*row, *(cell for group in groups for cell in cells[row, group]))
        for row in dict.fromkeys(case.row for case in study.cases)
    ]
    return (*study.headings, *headings), rows
