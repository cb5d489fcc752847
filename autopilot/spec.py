"""Options of the control law and of the ground stations, for every command that flies."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import msgspec

from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.control.registry import factory_of
from colibri.common.earth.home import DEFAULT_HOME, HomePlace
from colibri.common.earth.home import home as read_home
from colibri.common.process.spec import ProcessSpec
from colibri.common.spec import Option
from colibri.mavlink.client.events import StationEvent
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.services.identity import IdentityName
from colibri.plant.vehicle.description import Vehicle, load_vehicle

DEFAULT_PLANT = "udpout:127.0.0.1:14560"
TRACK = "spiral"  # the default track


class Trajectory(msgspec.Struct, frozen=True):
    """Samples of a track.

    Attributes:
        name: `samples:NAME`, to fly its text again.
        text: Content of a file of `samples:FILE`.
        note: Text on derived columns, for the user.
    """

    name: str
    text: str
    note: str = ""

    def __str__(self) -> str:
        return self.name


def name_of(given: str | Profile | Vehicle) -> str:
    """Return the name of a profile or vehicle, or the name that is given."""
    return given if isinstance(given, str) else given.name


@dataclass(frozen=True, kw_only=True)
class LawSpec:
    """The control law, and the vehicle it is made for."""

    profile: Annotated[str | Profile, Option("control profile name or .toml", "NAME")] = "flight"
    controller: Annotated[
        Any, Option("control law: a name, FILE.py, MODULE:NAME or POLICY.onnx (default: the profile's)", "NAME")
    ] = None
    solver: Annotated[str | None, Option("QP solver of qpsolvers (default: the profile's)", "NAME")] = None
    delay: Annotated[
        float | None,
        Option(
            "compensated delay from a frame to the effect of its command; 0: no compensation "
            "(default: the profile's, else as measured by the plant)",
            "MS",
            "ms",
            least=0.0,
            most=200.0,
        ),
    ] = None
    vehicle: Annotated[
        str | Vehicle | None, Option("vehicle to control, name or .toml (default: the profile's)", "NAME")
    ] = None
    floor: Annotated[
        float | None, Option("lowest height that a track may have (default: the ground, 0)", "M", "m", endless=True)
    ] = None
    feedback: Annotated[
        Feedback, Option("input of the autopilot: the true state (default) or simulated sensors", "state|sensors")
    ] = Feedback.STATE

    @property
    def law(self) -> Any:
        """Factory of a control law given as an object; None for a name."""
        return None if isinstance(self.controller, str | None) else factory_of(self.controller)

    @property
    def law_name(self) -> str | None:
        """Name of the control law; None for the profile's law."""
        return self.controller if self.law is None else getattr(self.law, "__name__", type(self.law).__name__)

    @property
    def delay_s(self) -> float | None:
        return None if self.delay is None else self.delay * 1e-3

    def load(self) -> tuple[Profile, Vehicle]:
        """Return the profile with the law, solver and delay of the options, and the vehicle to control.

        Raises:
            ProfileError: There is no such profile, or it is wrong.
            VehicleError: There is no such vehicle.
        """
        profile = self.chosen(load_profile(self.profile))
        return profile, load_vehicle(self.vehicle or profile.simulation.vehicle)

    def chosen(self, profile: Profile) -> Profile:
        """Return a profile with the law, solver and delay of the options.

        Raises:
            ProfileError: The control law has no QP to solve.
        """
        return profile.with_choices(self.law_name, self.solver, self.delay_s)


@dataclass(frozen=True, kw_only=True)
class GroundSpec:
    """Which ground stations may watch and command a flight."""

    gcs: Annotated[
        tuple[str, ...],
        Option(
            "link to ground stations, which may also send commands: udpout:, udpin:, tcp: or tcpin:HOST:PORT, or "
            "serial:DEVICE:BAUD",
            "URL",
            keyword=False,
        ),
    ] = ()
    signing_key: Annotated[
        Path | None, Option("sign messages with this key, and refuse unsigned messages", "FILE", keyword=False)
    ] = None
    insecure: Annotated[bool, Option("allow links to other computers without a key", keyword=False)] = False


@dataclass(frozen=True, kw_only=True)
class AutopilotSpec(LawSpec, GroundSpec, ProcessSpec):
    plant: Annotated[str, Option("link to the plant", "URL")] = DEFAULT_PLANT
    simulator: Annotated[
        str | None,
        Option("link to a simulator with PX4's interface and sensors, for example jMAVSim: tcp:127.0.0.1:4560", "URL"),
    ] = None
    track: Annotated[
        str | Trajectory | None, Option("track to fly, as in `colibri fly` (default spiral; with --gcs: none)", "TRACK")
    ] = None
    stepped: Annotated[
        str | None, Option("for tests: link to one program for all ground stations, frame by frame", "URL")
    ] = None
    tlog: Annotated[bool, Option("also append the frames of ground stations to flight.tlog in --out")] = False
    home: Annotated[HomePlace, Option("origin, degrees and m", "LAT,LON,ALT,YAW", read=read_home)] = DEFAULT_HOME
    identity: Annotated[IdentityName, Option("identity for ground stations")] = "px4"
    state: Annotated[Path | None, Option("folder of parameters, logs and files (default: not kept)", "DIR")] = None
    strict: Annotated[bool, Option("end at an exception in flight (default: replace the part and fly on)")] = False
    events: Annotated[
        tuple[StationEvent, ...], Option("modes and setpoints to send at their times", on_command_line=False)
    ] = ()
    params: Annotated[Mapping[str, int | float], Option("initial values of parameters", on_command_line=False)] = field(
        default_factory=dict
    )

    @property
    def served(self) -> bool:
        """Whether ground stations are served."""
        return bool(self.gcs or self.stepped)

    @property
    def flown(self) -> str | Trajectory | None:
        """Track flown from the start; None if ground stations command the flight."""
        return self.track if self.served else self.track or TRACK
