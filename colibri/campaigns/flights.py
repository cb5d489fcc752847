"""Fly one flight of a campaign."""

from collections import Counter
from collections.abc import Collection, Generator, Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from sys import modules
from typing import Any, NamedTuple

import cloudpickle

from colibri.analysis.outcome import files_of, fly_to_its_end
from colibri.autopilot.control.law_files import is_place, provide
from colibri.autopilot.control.loop import build_controller
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.control.registry import load_controller
from colibri.autopilot.control.settings import current_name
from colibri.autopilot.guidance.trajectories.loading import file_text
from colibri.campaigns.definition import Campaign, Logs, Metric, Point
from colibri.campaigns.engines import Engine, Killed
from colibri.campaigns.factors import CampaignError, key_of, with_keys
from colibri.common.errors import Error, ForeignError
from colibri.common.process.failure_file import FAILURE
from colibri.common.spec import from_values
from colibri.experiments.flight import Flight
from colibri.flights.effects import in_words
from colibri.flights.plan import Contents, FlightPlan
from colibri.flights.provenance import provenance_of
from colibri.flights.spec import FlightSpec, OptionError
from colibri.plant.texts import wind
from colibri.plant.vehicle.description import Vehicle, load_vehicle


class Verdict(StrEnum):
    FLOWN = "flown"
    LOST = "lost"  # flown to its end, but away from its track
    FAILED = "failed"  # ended early, for example because the control law raised
    REFUSED = "refused"  # the factors cannot be combined
    KILLED = "killed"  # its process was killed twice, the second time with this flight alone

    @property
    def is_lost(self) -> bool:
        return self in (Verdict.LOST, Verdict.FAILED, Verdict.KILLED)


class MetricError(CampaignError, ForeignError):
    """A user's metric function raised."""


class Common(NamedTuple):
    """What all flights share, with the contents of files."""

    fly: dict[str, Any]
    metrics: tuple[Metric, ...]
    logs: Logs
    profiles: dict[str, Profile]
    vehicles: dict[str, Vehicle]
    winds: dict[str, Any]
    track_files: dict[str, str]
    laws: Mapping[str, tuple[str, Any]] = {}


class FlightResult(NamedTuple):
    """The result of one flight."""

    flight: int
    verdict: Verdict
    why: str  # reason of the verdict; empty if flown
    metrics: tuple[float | None, ...]
    sha256: str  # hash of the trajectory; empty without one
    contents: str = ""  # hash of all inputs, as in the provenance
    files: Mapping[str, bytes] = {}  # logs to keep, by path relative to the campaign's folder


def common_of(campaign: Campaign, *, remote: bool = False) -> Common:
    """Read what all flights share, for `remote` workers with the laws of files."""
    profiles = {name: load_profile(name) for name in _names(campaign, "profile", "flight")}
    objects = [value for value in campaign.values("profile") if isinstance(value, Profile)]
    usual = {profile.simulation.vehicle for profile in (*profiles.values(), *objects)}
    vehicles = {*_names(campaign, "vehicle"), *_names(campaign, "plant_vehicle"), *usual}
    files = {track: file_text(track) for track in _names(campaign, "track")}
    return Common(
        fly=campaign.fly,
        metrics=campaign.metrics,
        logs=campaign.logs,
        profiles=profiles,
        vehicles={name: load_vehicle(name) for name in sorted(vehicles)},
        winds={name: wind(name) for name in _names(campaign, "wind") if name.endswith(".csv")},
        track_files={track: text for track, text in files.items() if text is not None},
        laws=_travelling(campaign) if remote else {},
    )


def _travelling(campaign: Campaign) -> dict[str, tuple[str, Any]]:
    """Return the laws of files by place; modules outside installed packages are pickled by value."""
    places = filter(is_place, _names(campaign, "controller"))
    laws = {place: (current_name(place), load_controller(place)) for place in places}
    given = (*(metric.of for metric in campaign.metrics), *campaign.values("controller"), *campaign.values("track"))
    for each in (*given, *(law for _, law in laws.values())):
        module = modules.get(getattr(each, "__module__", None) or "")
        file = getattr(module, "__file__", None)
        if module is not None and file and not {"site-packages", "colibri"} & {*Path(file).parts}:
            cloudpickle.register_pickle_by_value(module)
    return laws


def check(points: Iterable[Point], common: Common, *, ignored: Collection[str] = ()) -> list[str]:
    """Check that flights can begin; return lines on options without effect, but for those `ignored`."""
    plans = []
    for point in points:
        plan = plan_point(common, point)
        build_controller(plan.profile, plan.vehicle, lambda: 0.0, plan.spec.law)
        plans.append(plan.without_effect)
    found = Counter(each for plan in plans for each in plan.items() if each[0] not in ignored)
    on_all = in_words(each for each, times in found.items() if times == len(plans))
    on_some = in_words((each for each, times in found.items() if times < len(plans)), "no effect on some flights")
    return [line for line in (on_all, on_some) if line]


def fly_points(points: Iterable[Point], common: Common, engine: Engine) -> Generator[FlightResult, None, None]:
    with closing(engine.each(fly_point, common, points)) as results:
        for point, result in results:
            if isinstance(result, Killed):
                why = "the process that flew it was killed, and again when it flew this alone"
                result = FlightResult(point.flight, Verdict.KILLED, why, (None,) * len(common.metrics), "")
            yield result


def fly_point(common: Common, point: Point) -> FlightResult:
    nothing = (None,) * len(common.metrics)
    failure_file = f"{point.folder}/{FAILURE}"
    try:
        plan = plan_point(common, point)
        outcome = fly_to_its_end(plan, for_viewers=common.logs != "none", failure_file=failure_file)
    except Error as error:
        return FlightResult(point.flight, Verdict.REFUSED, str(error), nothing, "")
    verdict = Verdict.FAILED if outcome.failure else Verdict.LOST if outcome.lost else Verdict.FLOWN
    files = {failure_file: outcome.failure_text.encode()} if outcome.failure else {}
    if common.logs == "all" or (common.logs == "lost" and verdict.is_lost):
        kept = files_of(plan, outcome.report, outcome.log)
        files |= {f"{point.folder}/{name}": content for name, content in kept}
    contents = provenance_of(plan).sha256["all"]
    if outcome.report is None:
        return FlightResult(point.flight, verdict, outcome.lost, nothing, "", contents, files)
    flight = Flight(plan, outcome.report, outcome.log)
    metrics = tuple(_metric(metric, flight) for metric in common.metrics)
    return FlightResult(point.flight, verdict, outcome.lost, metrics, flight.sha256, contents, files)


def plan_point(common: Common, point: Point) -> FlightPlan:
    provide(common.laws)
    factors = common.fly | point.settings
    options = {name: value for name, value in factors.items() if key_of(name) is None} | {"seed": point.seed}
    if options.get("wind") in common.winds:
        options["wind"] = common.winds[options["wind"]]
    spec = from_values(FlightSpec, options, OptionError)
    profile = spec.chosen(with_keys(factors, "profile", _object(spec.profile, common.profiles)))
    assumed = _object(spec.vehicle or profile.simulation.vehicle, common.vehicles)
    vehicle = with_keys(factors, "vehicle", assumed)
    flown = _object(spec.plant_vehicle, common.vehicles) if spec.plant_vehicle else vehicle
    whole = with_keys(factors, "plant-vehicle", flown)
    plant_vehicle = whole.without(spec.without)
    if spec.link == "udp":  # its processes know neither `common` nor the keys
        spec = replace(spec, profile=profile, vehicle=vehicle, plant_vehicle=plant_vehicle)
    text = common.track_files.get(spec.track) if isinstance(spec.track, str) else file_text(spec.track)
    return FlightPlan.of(spec, Contents(profile, vehicle, plant_vehicle, text, whole))


def _object(given: Any, known: Mapping[str, Any]) -> Any:
    return known[given] if isinstance(given, str) else given


def _names(campaign: Campaign, option: str, usual: str | None = None) -> list[str]:
    always = option in (*campaign.fly, *campaign.grid, *campaign.draw)
    return [value for value in (*campaign.values(option), None if always else usual) if isinstance(value, str)]


def _metric(metric: Metric, flight: Flight) -> float | None:
    try:
        return metric.value(flight)
    except Exception as error:
        raise MetricError(f"metric {metric.name} raised {type(error).__name__}: {error}") from error
