"""A flight with its inputs read and checked."""

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, degrees, inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from colibri.autopilot.control.profile import Profile
from colibri.autopilot.guidance.trajectories.loading import file_text, load_track
from colibri.autopilot.guidance.trajectories.planner import start_yaw
from colibri.autopilot.guidance.trajectories.tracks import Track, position
from colibri.autopilot.process.planned_events import station_events
from colibri.autopilot.spec import AutopilotSpec, name_of
from colibri.common.errors import Error, checked
from colibri.common.spec import part_of
from colibri.flights.effects import FlownOptions, without_effect
from colibri.flights.spec import FlightSpec
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.links.open import check_reach
from colibri.plant.events import check_events, plant_events
from colibri.plant.physics.contact import check_contact
from colibri.plant.physics.start import Start, check_start
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle

_loaded = lru_cache(maxsize=16)(load_track)
"""Flights that differ in seed, wind or start alone share their track."""


def unseen(_what: object) -> None:
    """Ignore progress."""


class FrameCount(NamedTuple):
    """Wall-clock time, frames exchanged, and frames sent again."""

    wall_time_s: float
    frames: int
    resent: int


class PlanError(Error):
    """Options that cannot be combined."""


_ALIKE_DEG, _SECTORS = 45.0, 8  # bearings of rotors are compared to the nearest eighth of a turn


class Contents(NamedTuple):
    """The contents of the files named in a specification."""

    profile: Profile
    vehicle: Vehicle
    plant_vehicle: Vehicle  # without the parts left out
    track_file: str | None  # text of the track's file, if it has one
    whole: Vehicle | None = None  # the plant's vehicle with the parts left out; `None` in a recorded flight


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """A flight that can begin."""

    spec: FlightSpec
    contents: Contents
    start: Start
    track: Track  # track to fly, adapted to the vehicle's limits
    track_note: str  # changes of the track, or the limit that it exceeds; else empty

    @classmethod
    def of(cls, spec: FlightSpec, contents: Contents | None = None) -> "FlightPlan":
        """Return the plan of a flight; without `contents`, files are read.

        Raises:
            PlanError, EventError, LinkError: Options cannot be combined.
            ProfileError, VehicleError, TrackError: A file is invalid, or the vehicle cannot fly so.
        """
        checked("spec", spec, FlightSpec, "a FlightSpec, as of FlightSpec.of", PlanError)
        if spec.gcs and spec.link != "udp":
            raise PlanError(f"--gcs needs --link udp: over {spec.link} no autopilot process runs")
        check_reach(spec.gcs, signed=spec.signing_key is not None, insecure=spec.insecure)
        if contents is None:
            profile, vehicle = spec.load()
            whole = load_vehicle(spec.plant_vehicle or spec.vehicle or profile.simulation.vehicle)
            contents = Contents(profile, vehicle, whole.without(spec.without), file_text(spec.track), whole)
        profile, vehicle, plant_vehicle, track_file, _ = contents
        if spec.params:
            from colibri.autopilot.parameters.definitions import with_parameters  # slow to load

            chosen = with_parameters(profile, vehicle, dict(spec.params), served=bool(spec.gcs))
            if not spec.gcs:
                profile, vehicle = chosen
                contents = contents._replace(profile=profile, vehicle=vehicle)
        names = _names(spec, profile)
        on_sensors = spec.feedback is Feedback.SENSORS
        for name, each in zip(names, (vehicle, plant_vehicle), strict=True):
            if on_sensors and each.sensors is None:
                raise PlanError(f"--feedback sensors: vehicle {name} has no table sensors")
            if on_sensors and each.ground is None:
                why = "has no ground to stand on until the estimate is valid"
                raise PlanError(f"--feedback sensors: vehicle {name} {why}")
        _check_order(vehicle, plant_vehicle)
        floor_m = _floor_m(spec, plant_vehicle)
        served = bool(spec.gcs) or contents.whole is None  # stations of a recorded flight are not kept
        check_events(spec.events, plant_vehicle, on_sensors=on_sensors, served=served)
        if spec.gcs:
            station_events(spec.events)
        track, note = _loaded(spec.track, vehicle, profile, floor_m, track_file)
        start = spec.started(_usual_start(profile, plant_vehicle, track, spec.feedback))
        try:
            check_contact(plant_vehicle)
        except VehicleError as error:
            raise VehicleError(f"{names[1]}: {error}") from error
        check_start(start, plant_vehicle)
        return cls(spec=spec, contents=contents, start=start, track=track, track_note=note)

    @property
    def profile(self) -> Profile:
        """The profile, with the law, solver and delay of the options."""
        return self.contents.profile

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that the autopilot controls."""
        return self.contents.vehicle

    @property
    def plant_vehicle(self) -> Vehicle:
        """The plant's vehicle, without omitted parts."""
        return self.contents.plant_vehicle

    @property
    def out(self) -> Path:
        """The folder of the flight."""
        return self.spec.out

    @property
    def vehicle_name(self) -> str:
        """Name or file of the autopilot's vehicle."""
        return _names(self.spec, self.profile)[0]

    @property
    def plant_vehicle_name(self) -> str:
        """Name or file of the plant's vehicle."""
        return _names(self.spec, self.profile)[1]

    @property
    def without_effect(self) -> dict[str, str]:
        """Options without effect, with reasons."""
        name, whole = self.plant_vehicle_name, self.contents.whole
        return without_effect(FlownOptions(self.spec, name, self.vehicle, self.plant_vehicle, whole))

    @property
    def integrator(self) -> Any:
        """The plant's integrator: `rk4` or `adaptive`."""
        return self.spec.integrator or self.profile.simulation.integrator

    @property
    def floor_m(self) -> float:
        """Least height of the track, z of ENU; -inf without a floor."""
        return _floor_m(self.spec, self.plant_vehicle)

    @property
    def flown_by(self) -> str:
        """Profile, and control law unless it is the profile's."""
        law = self.spec.law_name
        return f"profile {self.profile.name}" + (f", controller {law}" if law else "")

    @property
    def start_yaw_rad(self) -> float:
        """The first yaw reference, which is also the default initial yaw."""
        return start_yaw(self.track, self.profile.references)

    def plant_spec(self, link: str) -> PlantSpec:
        """Return the specification of the plant, which listens at a link."""
        spec, tlog = self.spec, self.spec.tlog or bool(self.spec.gcs)
        vehicle = spec.plant_vehicle or spec.vehicle or self.profile.simulation.vehicle
        given = {"integrator": self.integrator, "start": self.start._asdict(), "events": plant_events(spec.events)}
        return part_of(spec, PlantSpec, link=link, vehicle=vehicle, speed=spec.pace, tlog=tlog, **given)

    def autopilot_spec(self, plant: str) -> AutopilotSpec:
        """Return the specification of the autopilot, which calls the plant."""
        spec, tlog = self.spec, self.spec.tlog or bool(self.spec.gcs)
        given = {"params": dict(spec.params), "events": station_events(spec.events) if spec.gcs else ()}
        return part_of(spec, AutopilotSpec, plant=plant, floor=self.floor_m, tlog=tlog, **given)


def _names(spec: FlightSpec, profile: Profile) -> tuple[str, str]:
    vehicle = name_of(spec.vehicle or profile.simulation.vehicle)
    plant_vehicle = name_of(spec.plant_vehicle or vehicle)
    same = plant_vehicle != vehicle or spec.plant_vehicle in (None, spec.vehicle, vehicle)
    return vehicle, plant_vehicle if same else f"{plant_vehicle} (2)"


def _check_order(vehicle: Vehicle, plant_vehicle: Vehicle) -> None:
    """Refuse a plant with the same rotors in another order."""
    ours, plants = (
        [(round(degrees(atan2(-y, x)) / _ALIKE_DEG) % _SECTORS, z) for x, y, z in each.rotors.points_m().tolist()]
        for each in (vehicle, plant_vehicle)
    )
    if ours != plants and sorted(ours) == sorted(plants):
        raise PlanError(
            "--plant-vehicle: its rotors are those of --vehicle in another order: list both alike (--order)"
        )


def _floor_m(spec: FlightSpec, plant_vehicle: Vehicle) -> float:
    return spec.floor if spec.floor is not None else -inf if plant_vehicle.ground is None else 0.0


def _usual_start(profile: Profile, vehicle: Vehicle, flown: Track, feedback: Feedback) -> Start:
    x, y, z = profile.simulation.position_enu_m or position(flown, np.zeros(1))[0].tolist()
    yaw_deg = degrees(start_yaw(flown, profile.references))
    if feedback is Feedback.SENSORS:
        return Start(x=x, y=y, psi=yaw_deg)
    given = profile.simulation.rotor_speed_rpm
    return Start(x=x, y=y, z=z, psi=yaw_deg, rotors=vehicle.hover_rpm if given is None else given)
