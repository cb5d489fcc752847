"""`provenance.json` in the folder of a flight: all that it is made of, by content; its files may change after it."""

from argparse import Namespace
from hashlib import sha256
from importlib.metadata import version
from math import inf, isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import Origin, origin_of, origin_of_factory
from colibri.autopilot.guidance.trajectories.loading import file_text, with_file
from colibri.common.errors import Error
from colibri.common.process.lifecycle import fail
from colibri.flights.folder import PROVENANCE
from colibri.flights.plan import FlightPlan
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.environment.weather import RecordedWind
from colibri.plant.process.options import gust, recorded_wind, wind
from colibri.plant.vehicle.description import Vehicle


class ProvenanceError(Error):
    """A folder that does not say what was flown in it."""


class Options(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The options of a flight that are in no file, as the command line has them."""

    integrator: str
    link: str
    feedback: Feedback
    duration: float
    seed: int
    start: dict[str, float]
    latency: float
    floor: float | None
    wind: str
    gusts: list[str]
    turbulence: str | None


class Names(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What it was called that is kept by its content; a track's name has its options, too."""

    track: str
    profile: str
    vehicle: str
    plant_vehicle: str
    without: list[str]
    solver: str | None
    controller: str | None = None


class Provenance(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All that a flight is made of.

    Attributes:
        colibri: Version that flew it.
        names: Of what follows by content.
        options: All others.
        profile: With controller, solver and delay of the options.
        law: Where the control law comes from.
        vehicle: That the autopilot controlled.
        plant_vehicle: That the plant flew, its parts left out.
        track_file: What was in the file of waypoints, if there was one.
        wind_file: What was in the file of the wind, if there was one.
        sha256: Of each of these but the names, and as `all` of all of them.
    """

    colibri: str
    names: Names
    options: Options
    profile: Profile
    law: Origin
    vehicle: Vehicle
    plant_vehicle: Vehicle
    track_file: str | None
    wind_file: str | None
    sha256: dict[str, str]


def provenance_of(plan: FlightPlan) -> Provenance:
    """Return what a flight is made of.

    Raises:
        TrackError: The file of its waypoints cannot be read.
        ControllerError: There is no such control law.
    """
    options = Options(
        integrator=plan.integrator,
        link=plan.link,
        feedback=plan.feedback,
        duration=plan.duration_s,
        seed=plan.seed,
        start=plan.start._asdict(),
        latency=plan.latency,
        floor=plan.floor_m if isfinite(plan.floor_m) else None,
        wind=str(plan.weather.wind),
        gusts=[str(each) for each in plan.weather.gusts],
        turbulence=plan.weather.turbulence,
    )
    contents: dict[str, Any] = {
        "options": options,
        "profile": plan.profile,
        "law": origin_of_factory(plan.law) if plan.law else origin_of(plan.profile.controller),
        "vehicle": plan.vehicle,
        "plant_vehicle": plan.plant_vehicle,
        "track_file": file_text(plan.track_name),
        "wind_file": _wind_file(plan.weather.wind),
    }
    nameless = {
        "profile": msgspec.structs.replace(plan.profile, name="", file=""),
        "options": msgspec.structs.replace(options, wind="") if contents["wind_file"] else options,
        "track": with_file(plan.track_name, Path()),
    }
    colibri = version("colibri-sitl")
    hashes = {name: _hash(content) for name, content in (contents | nameless).items() if content is not None}
    return Provenance(
        colibri=colibri,
        names=Names(
            track=plan.track_name,
            profile=plan.profile_name,
            vehicle=plan.vehicle_name,
            plant_vehicle=plan.plant_vehicle_name,
            without=list(plan.without),
            solver=plan.solver,
            controller=plan.controller,
        ),
        sha256={**hashes, "all": _hash([colibri, hashes])},
        **contents,
    )


def write_provenance(plan: FlightPlan) -> None:
    """Write what a flight is made of to its folder, or end with one line."""
    text = msgspec.json.format(msgspec.json.encode(provenance_of(plan)), indent=1)
    try:
        (plan.out / PROVENANCE).write_bytes(text + b"\n")
    except OSError as error:
        fail(f"cannot write to --out {plan.out}: {error.strerror}")


def read_provenance(folder: Path) -> Provenance:
    """Return what the flight of a folder is made of.

    Raises:
        ProvenanceError: The folder does not say.
    """
    path = folder / PROVENANCE
    try:
        return msgspec.json.decode(path.read_bytes(), type=Provenance)
    except FileNotFoundError as error:
        raise ProvenanceError(f"{path} is missing: {folder} is no folder of a flight of this version") from error
    except OSError as error:
        raise ProvenanceError(f"cannot read {path}: {error.strerror}") from error
    except msgspec.MsgspecError as error:
        raise ProvenanceError(f"{path}: {error}") from error


def plan_of(folder: Path) -> FlightPlan:
    """Return the plan of the flight of a folder, from what is kept there alone.

    Raises:
        ProvenanceError: The folder does not say what was flown.
        TrackError: This version knows no such track.
    """
    kept = read_provenance(folder)
    names, options = kept.names, kept.options
    args = Namespace(
        **{name: getattr(names, name) for name in names.__struct_fields__},
        **{name: getattr(options, name) for name in options.__struct_fields__ if name not in ("wind", "gusts")},
        wind=wind(options.wind) if kept.wind_file is None else recorded_wind(Path(options.wind), kept.wind_file),
        gusts=[gust(text) for text in options.gusts],
        gcs=(),
        signing_key=None,
        insecure=False,
        speed=inf,
        delay=None,
        out=folder,
    )
    if kept.track_file is None:
        return FlightPlan.of_contents(args, names.track, kept.profile, kept.vehicle, kept.plant_vehicle)
    with TemporaryDirectory() as scratch:
        path = Path(scratch) / "waypoints.csv"
        path.write_text(kept.track_file, encoding="utf-8")
        through = with_file(names.track, path)
        return FlightPlan.of_contents(args, through, kept.profile, kept.vehicle, kept.plant_vehicle)


def _wind_file(blows: object) -> str | None:
    """Return what is in the file of a recorded wind, number by number."""
    if not isinstance(blows, RecordedWind):
        return None
    rows = zip(blows.times_s, blows.velocities_enu_m_s, strict=True)
    return "\n".join(["t,east,north,up", *(",".join(map(repr, (t, *velocity))) for t, velocity in rows)]) + "\n"


def _hash(content: object) -> str:
    return sha256(msgspec.json.encode(content, order="sorted")).hexdigest()
