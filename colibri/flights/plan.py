"""What to fly: the command line of `colibri fly`, resolved and checked before anything starts."""

import argparse
from dataclasses import dataclass, fields
from math import degrees, inf
from pathlib import Path
from typing import Any, NamedTuple

from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.control.registry import Factory
from colibri.autopilot.guidance.trajectories.loading import load_track
from colibri.autopilot.guidance.trajectories.planner import start_yaw
from colibri.autopilot.guidance.trajectories.tracks import DURATION_S, Track
from colibri.autopilot.process.options import delay_s
from colibri.common.errors import Error
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.links.open import check_reach
from colibri.plant.environment.weather import Weather, weather_of
from colibri.plant.physics.contact import check_contact
from colibri.plant.physics.start import Start, check_start
from colibri.plant.simulation.setting import WorldSetting, world_values
from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle

OPTIONS = (
    *(each.name for each in fields(WorldSetting)),
    *("solver", "delay", "vehicle", "plant_vehicle", "integrator", "feedback", "duration"),
)
"""Names of the options that every command has that flies; track, profile, controller, link and folder are its own."""


def unseen(_what: object) -> None:
    """Show nothing: neither simulated time, s, nor a line of text."""


class Summary(NamedTuple):
    """What only the run itself can give: wall-clock time of the flight, frames exchanged and sent again."""

    wall_time_s: float
    frames: int
    resent: int


@dataclass(frozen=True, slots=True)
class GroundAccess:
    """Which ground stations may watch and command a flight.

    Attributes:
        links: URLs to call or to wait on; none without ground stations.
        signing_key: File of the key that both sides sign with.
        insecure: Whether links may leave this computer without one.
    """

    links: tuple[str, ...] = ()
    signing_key: Path | None = None
    insecure: bool = False


class PlanError(Error):
    """Options that cannot be combined; the message is the one line that a user needs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan(WorldSetting):
    """A flight by its options, in the world of a `WorldSetting`.

    Attributes:
        track_name: The track, with its options.
        profile_name: Profile name or file.
        vehicle_name: Vehicle that the autopilot controls, name or file.
        plant_vehicle_name: Vehicle that the plant flies, name or file.
        start: How the plant begins.
        integrator: `rk4` or `adaptive`.
        link: `udp`, `memory` or `direct`.
        speed: Times real time; infinite for flat out.
        feedback: What the plant sends to the autopilot.
        duration_s: Simulated time to fly.
        out: Folder for all that the flight leaves.
        controller: Control law by option; None for the profile's.
        solver: QP solver by option; None for the profile's.
        delay: That is compensated, ms, by option; None for the profile's.
        ground: Who may watch and command.
        floor_m: Below which no track may lead, z of ENU; -inf for anywhere.
        track: The track to fly, changed where the vehicle could not fly it.
        track_note: What was changed, or which limit the track exceeds; empty for nothing.
        profile: The profile, with controller, solver and delay of the options.
        vehicle: The vehicle that the autopilot controls.
        plant_vehicle: The vehicle that the plant flies, its parts left out.
        law: Makes the control law; None: as it is registered.
        ulog: Whether `flight.ulg` is written.
    """

    track_name: str
    profile_name: str
    vehicle_name: str
    plant_vehicle_name: str
    start: Start
    integrator: str
    link: str
    speed: float
    feedback: Feedback
    duration_s: float
    out: Path
    controller: str | None
    solver: str | None
    delay: float | None
    ground: GroundAccess
    floor_m: float
    track: Track
    track_note: str
    profile: Profile
    vehicle: Vehicle
    plant_vehicle: Vehicle
    law: Factory | None = None
    ulog: bool = True

    @classmethod
    def from_arguments(cls, args: argparse.Namespace) -> "FlightPlan":
        """Resolve the command line.

        Raises:
            PlanError: Ground stations are invited to a flight that has no links to them; or sensors are to be flown by
                that the vehicle has not, or without ground to stand on.
            LinkError: What invites a ground station names no link, or would let anybody on the network fly the vehicle.
            ProfileError: The profile cannot be read.
            VehicleError: A vehicle cannot be read, or cannot start as the profile says.
            TrackError: There is no such track, it leads below the floor, or its file cannot be flown.
        """
        if args.gcs and args.link != "udp":
            raise PlanError(f"--gcs needs --link udp: over {args.link} there is no autopilot to connect to")
        check_reach(args.gcs, signed=args.signing_key is not None, insecure=args.insecure)
        profile = load_profile(args.profile).with_choices(args.controller, args.solver, delay_s(args.delay))
        vehicle_name = args.vehicle or profile.simulation.vehicle
        plant_vehicle = load_vehicle(args.plant_vehicle or vehicle_name).without(args.without)
        return cls.of_contents(args, args.track, profile, load_vehicle(vehicle_name), plant_vehicle)

    @classmethod
    def of_contents(
        cls,
        args: argparse.Namespace,
        track_name: str,
        profile: Profile,
        vehicle: Vehicle,
        plant_vehicle: Vehicle,
        law: Factory | None = None,
    ) -> "FlightPlan":
        """Resolve a command line whose profile and vehicles were read already, its track being read by `track_name`.

        Raises:
            PlanError: Sensors are to be flown by that the vehicle has not, or without ground to stand on.
            VehicleError: A vehicle cannot start as the profile says.
            TrackError: There is no such track, it leads below the floor, or its file cannot be flown.
        """
        vehicle_name = args.vehicle or profile.simulation.vehicle
        plant_vehicle_name = args.plant_vehicle or vehicle_name
        if args.feedback is Feedback.SENSORS:
            _check_sensors(vehicle_name, vehicle)
            _check_sensors(plant_vehicle_name, plant_vehicle)
        floor_m = args.floor if args.floor is not None else -inf if plant_vehicle.ground is None else 0.0
        to_fly, note = load_track(track_name, vehicle, profile, floor_m)
        start = _start_of(profile, to_fly, args.feedback)._replace(**args.start)
        try:
            check_contact(plant_vehicle)
        except VehicleError as error:
            raise VehicleError(f"{plant_vehicle_name}: {error}") from error
        check_start(start, plant_vehicle)
        return cls(
            **(world_values(args) | {"start": start}),
            track_name=args.track,
            profile_name=args.profile,
            vehicle_name=vehicle_name,
            plant_vehicle_name=plant_vehicle_name,
            integrator=args.integrator or profile.simulation.integrator,
            link=args.link,
            speed=args.speed or (1.0 if args.gcs else inf),
            feedback=args.feedback,
            duration_s=args.duration,
            out=args.out,
            controller=args.controller,
            solver=args.solver,
            delay=args.delay,
            ground=GroundAccess(tuple(args.gcs), args.signing_key, args.insecure),
            floor_m=floor_m,
            track=to_fly,
            track_note=note,
            profile=profile,
            vehicle=vehicle,
            plant_vehicle=plant_vehicle,
            law=law,
        )

    @classmethod
    def of_options(cls, out: Path, **options: Any) -> "FlightPlan":
        """Return the plan of a flight flat out for 100 s with some options of `colibri fly`, by their names there.

        Raises:
            PlanError, ProfileError, VehicleError, TrackError: As `from_arguments`.
        """
        unset = dict.fromkeys(("controller", "solver", "delay", "vehicle", "plant_vehicle", "integrator", "floor"))
        usual = {
            "gcs": (),
            "signing_key": None,
            "insecure": False,
            "feedback": Feedback.STATE,
            "link": "direct",
            "speed": inf,
            "duration": DURATION_S,
        }
        values = world_values(WorldSetting()) | unset | usual | options
        return cls.from_arguments(argparse.Namespace(**values, out=out))

    @property
    def flown_by(self) -> str:
        """Profile, and control law if it is not the profile's, as tables and figures have them."""
        return f"profile {self.profile.name}" + (f", controller {self.controller}" if self.controller else "")

    @property
    def weather(self) -> Weather:
        """In which the plant flies."""
        return weather_of(self)

    @property
    def start_yaw_rad(self) -> float:
        """The first yaw reference, with which the vehicle starts unless the options have another."""
        return start_yaw(self.track, self.profile.references)


def _check_sensors(name: str, vehicle: Vehicle) -> None:
    """Check that a flight on sensors can begin, at rest."""
    if vehicle.sensors is None:
        raise PlanError(f"--feedback sensors: vehicle {name} has no table sensors")
    if vehicle.ground is None:
        raise PlanError(f"--feedback sensors: vehicle {name} has no ground to stand on while it finds its bearings")


def _start_of(profile: Profile, flown: Track, feedback: Feedback) -> Start:
    """Return how the flights of a profile begin: at rest, with the first yaw of the track; on sensors on the ground."""
    x, y, z = profile.simulation.position_enu_m
    yaw_deg = degrees(start_yaw(flown, profile.references))
    if feedback is Feedback.SENSORS:
        return Start(x=x, y=y, psi=yaw_deg)
    return Start(x=x, y=y, z=z, psi=yaw_deg, rotors=profile.simulation.rotor_speed_rpm)
