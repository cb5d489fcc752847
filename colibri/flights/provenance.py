"""`provenance.json`: all inputs of a flight by content, as their files may change."""

from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.registry import Origin, origin_of, origin_of_factory
from colibri.autopilot.guidance.trajectories.loading import with_file
from colibri.autopilot.spec import name_of
from colibri.common.config import UNREADABLE
from colibri.common.errors import Error
from colibri.common.files import read_bytes
from colibri.common.process.lifecycle import fail
from colibri.common.spec import from_values, plain_values
from colibri.flights.folder import PROVENANCE
from colibri.flights.plan import Contents, FlightPlan
from colibri.flights.spec import FlightSpec
from colibri.plant.environment.weather import RecordedWind
from colibri.plant.vehicle.description import Vehicle

_version = cache(version)  # it reads a file of the package
_NOT_KEPT = ("out", "tlog", "gcs", "signing_key", "insecure", "speed")  # options without effect on the flight
_NAMES = ("track", "profile", "controller", "solver", "delay", "vehicle", "plant_vehicle", "without")
"""Options that are recorded by the contents they name."""


class ProvenanceError(Error):
    """A folder without a valid record of its flight."""


class Provenance(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The inputs of a flight."""

    colibri: str
    spec: dict[str, Any]
    profile: Profile  # with the law, solver and delay of the options
    law: Origin
    vehicle: Vehicle
    plant_vehicle: Vehicle  # without the parts left out
    track_file: str | None
    sha256: dict[str, str]  # hash of each of these without names, and of all of them as `all`


def provenance_of(plan: FlightPlan) -> Provenance:
    values = plain_values(_named(plan), whole=True)
    values = {name: value for name, value in values.items() if name not in _NOT_KEPT}
    contents: dict[str, Any] = {
        "profile": plan.profile,
        "law": origin_of_factory(plan.spec.law) if plan.spec.law else origin_of(plan.profile.controller),
        "vehicle": plan.vehicle,
        "plant_vehicle": plan.plant_vehicle,
        "track_file": plan.contents.track_file,
    }
    options = {name: value for name, value in values.items() if name not in _NAMES}
    if isinstance(plan.spec.wind, RecordedWind):
        options["wind"] = {**options["wind"], "path": ""}
    nameless = {
        "profile": msgspec.structs.replace(plan.profile, name="", file=""),
        "options": options,
        "track": with_file(str(plan.spec.track), Path()),
    }
    colibri = _version("colibri-sitl")
    hashes = {name: hash_of(content) for name, content in (contents | nameless).items() if content is not None}
    return Provenance(colibri=colibri, spec=values, sha256={**hashes, "all": hash_of([colibri, hashes])}, **contents)


def _named(plan: FlightPlan) -> FlightSpec:
    return replace(
        plan.spec,
        track=str(plan.spec.track),
        profile=name_of(plan.spec.profile),
        controller=plan.profile.controller if plan.spec.controller else None,
        vehicle=plan.vehicle_name,
        plant_vehicle=plan.plant_vehicle_name,
        integrator=plan.integrator,
        start=plan.start._asdict(),
        floor=plan.floor_m,
    )


def encoded_provenance(plan: FlightPlan) -> bytes:
    return msgspec.json.format(msgspec.json.encode(provenance_of(plan)), indent=1) + b"\n"


def write_provenance(plan: FlightPlan) -> None:
    content = encoded_provenance(plan)
    try:
        (plan.out / PROVENANCE).write_bytes(content)
    except OSError as error:
        fail(f"cannot write to --out {plan.out}: {error.strerror}")


def read_provenance(folder: Path) -> Provenance:
    path = folder / PROVENANCE
    if folder.is_file():
        raise ProvenanceError(f'"{folder}" is a file: expected the folder of a flight, as colibri fly --out writes it')
    try:
        return msgspec.json.decode(read_bytes(path), type=Provenance)
    except FileNotFoundError as error:
        raise ProvenanceError(f"{path} is missing: {folder} is not a flight folder of this version") from error
    except OSError as error:
        raise ProvenanceError(f"cannot read {path}: {error.strerror}") from error
    except UNREADABLE as error:
        raise ProvenanceError(f"{path}: {error}") from error


def plan_of(folder: Path) -> FlightPlan:
    """Return the plan of a recorded flight from its folder alone."""
    kept = read_provenance(folder)
    spec = from_values(FlightSpec, {**kept.spec, "out": folder}, ProvenanceError)
    return FlightPlan.of(spec, Contents(kept.profile, kept.vehicle, kept.plant_vehicle, kept.track_file))


def hash_of(content: object) -> str:
    return sha256(msgspec.json.encode(content, order="sorted")).hexdigest()
