"""One flight of a campaign, where it is flown: from its factors to its row."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from colibri.analysis.outcome import fly_to_its_end
from colibri.autopilot.control.loop import build_controller
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.guidance.trajectories.loading import file_text, with_file
from colibri.campaigns.definition import Campaign, Logs, Point
from colibri.campaigns.factors import key_of, with_keys
from colibri.campaigns.metrics import Metric
from colibri.campaigns.values import CampaignError, Choice
from colibri.common.errors import Error, ForeignError
from colibri.common.process.failure_file import FAILURE
from colibri.experiments.flight import Flight, plan_of
from colibri.flights.plan import FlightPlan
from colibri.plant.process.options import wind
from colibri.plant.vehicle.description import Vehicle, load_vehicle


class Verdict(StrEnum):
    """What came of a flight, in one word."""

    FLOWN = "flown"
    LOST = "lost"
    """It came to its end, but not where it should."""
    FAILED = "failed"
    """It came to an early end: its control law raised, say."""
    REFUSED = "refused"
    """Its factors cannot be flown together."""
    KILLED = "killed"
    """The process that flew it was killed, and killed again when it was flown alone."""

    @property
    def is_lost(self) -> bool:
        """Whether it was flown, and the vehicle did not come through."""
        return self in (Verdict.LOST, Verdict.FAILED, Verdict.KILLED)


class MetricError(CampaignError, ForeignError):
    """A function that makes a metric of a flight raised."""


class Common(NamedTuple):
    """What all flights of a campaign need, wherever they are flown: no file of this computer.

    Attributes:
        fly: Options and keys that every flight has.
        metrics: What is kept of each.
        logs: Of which flights the logs are kept.
        profiles: By the names and files that they go by.
        vehicles: The same.
        winds: The same.
        track_files: What is in the files that tracks go through, by the tracks' names.
    """

    fly: dict[str, Any]
    metrics: tuple[Metric, ...]
    logs: Logs
    profiles: dict[str, Profile]
    vehicles: dict[str, Vehicle]
    winds: dict[str, Any]
    track_files: dict[str, str]


class Flown(NamedTuple):
    """What came of one flight.

    Attributes:
        flight: Its number, which is its place in the table.
        verdict: In one word.
        why: In a line; empty where it was flown.
        metrics: Those of the campaign; None for what this flight does not have.
        sha256: Of its trajectory; empty for none.
        files: What is kept of its folder, by name.
    """

    flight: int
    verdict: Verdict
    why: str
    metrics: tuple[float | None, ...]
    sha256: str
    files: Mapping[str, bytes] = {}


def common_of(campaign: Campaign) -> Common:
    """Return what the flights of a campaign need, read from its files.

    Raises:
        Error: One of them cannot be read.
    """
    profiles = {name: load_profile(name) for name in _names(campaign, "profile", "flight")}
    objects = [value for value in _values(campaign, "profile") if isinstance(value, Profile)]
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
    )


def check(campaign: Campaign, common: Common) -> None:
    """Plan flights in which each value of each factor is there once, and build their control laws.

    Raises:
        Error: One of them cannot begin.
    """
    for point in campaign.samples():
        with TemporaryDirectory(prefix="colibri-") as folder:
            plan = _plan(common, point, Path(folder))
            build_controller(plan.profile, plan.vehicle, lambda: 0.0, plan.law)


def fly_point(common: Common, point: Point) -> Flown:
    """Fly once; return what came of it. Nothing stays on the disk."""
    nothing = (None,) * len(common.metrics)
    with TemporaryDirectory(prefix="colibri-") as scratch:
        folder = Path(scratch) / "flight"
        try:
            plan = _plan(common, point, folder)
            outcome = fly_to_its_end(plan)
        except Error as error:
            why = str(error).replace(scratch, "")
            return Flown(point.flight, Verdict.REFUSED, why, nothing, "")
        verdict = Verdict.FAILED if outcome.failure else Verdict.LOST if outcome.lost else Verdict.FLOWN
        keep = common.logs == "all" or (common.logs == "lost" and verdict.is_lost)
        files = _files(folder, folder.iterdir() if keep else [folder / FAILURE], folder_of(point.flight))
        why = outcome.lost.replace(str(folder), folder_of(point.flight))
        if outcome.report is None:
            return Flown(point.flight, verdict, why, nothing, "", files)
        flight = Flight(plan, outcome.report)
        metrics = tuple(_metric(metric, flight) for metric in common.metrics)
        return Flown(point.flight, verdict, why, metrics, flight.sha256, files)


def folder_of(index: int) -> str:
    """Return the folder of what is kept of a flight, within that of its campaign."""
    return f"flights/{index:06d}"


def _plan(common: Common, point: Point, out: Path) -> FlightPlan:
    """Return the plan of a flight, from nothing but `common` and its factors."""
    factors = common.fly | point.factors
    options = {name: value for name, value in factors.items() if key_of(name) is None} | {"seed": point.seed}
    track = str(options.pop("track"))
    if options.get("link") == "udp":
        changed = next((name for name in factors if key_of(name) is not None), None)
        if changed is not None:
            raise CampaignError(f"{changed}: over udp two processes fly, which know files: leave link out")
        return plan_of(track, options, out)
    profile = _object(options.get("profile") or "flight", common.profiles)
    vehicle = _object(options.get("vehicle") or profile.simulation.vehicle, common.vehicles)
    plant_vehicle = _object(options["plant_vehicle"], common.vehicles) if options.get("plant_vehicle") else None
    profile, vehicle = with_keys(factors, "profile", profile), with_keys(factors, "vehicle", vehicle)
    options |= {"profile": profile, "vehicle": vehicle}
    options["plant_vehicle"] = with_keys(factors, "plant-vehicle", plant_vehicle or vehicle)
    if options.get("wind") in common.winds:
        options["wind"] = common.winds[options["wind"]]
    if track in common.track_files:
        file = out.with_name("track.csv")
        file.write_text(common.track_files[track], encoding="utf-8")
        track = with_file(track, file)
    return plan_of(track, options, out)


def _object(given: Any, known: Mapping[str, Any]) -> Any:
    return known[given] if isinstance(given, str) else given


def _values(campaign: Campaign, option: str) -> Iterable[Any]:
    """Return all that an option is set to somewhere in a campaign."""
    draw = campaign.draw.get(option)
    drawn = draw.values if isinstance(draw, Choice) else ()
    said = (campaign.fly[option],) if option in campaign.fly else ()
    return (*said, *campaign.grid.get(option, ()), *drawn)


def _names(campaign: Campaign, option: str, usual: str | None = None) -> list[str]:
    """Return the names that an option is set to; where it is set to nothing, the usual one."""
    values = list(_values(campaign, option)) or ([] if usual is None else [usual])
    return [value for value in values if isinstance(value, str)]


def _metric(metric: Metric, flight: Flight) -> float | None:
    try:
        return metric.value(flight)
    except Exception as error:
        raise MetricError(f"metric {metric.name} raised {type(error).__name__}: {error}") from error


def _files(folder: Path, wanted: Iterable[Path], called: str) -> dict[str, bytes]:
    """Return what is in files that there are; where text says where it lies, it says where it will lie."""
    found = {}
    for path in wanted:
        with suppress(FileNotFoundError):
            found[path.name] = path.read_bytes().replace(str(folder).encode(), called.encode())
    return found
