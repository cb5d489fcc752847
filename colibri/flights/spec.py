"""All options of a flight."""

from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from colibri.autopilot.spec import GroundSpec, LawSpec, Trajectory
from colibri.common.errors import Error, shown
from colibri.common.process.arguments import number
from colibri.common.spec import Option, from_values
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import Vehicle

TRACK_HELP = (
    "the thesis's spiral, expanding-spiral, line, wave or crown; or, with options as KEY=VALUE[,KEY=VALUE...], "
    "hover[:x=0,y=0,height=2,yaw=0], lemniscate[:size=4,height=3,lap=6,yaw=path|fixed], "
    "circle[:radius=2,speed=2,height=2,yaw=path|fixed], ramped[:curve=circle,speed=5,acceleration=0.25,radius=5,"
    "turn=left|right,heading=0], waypoints:FILE[,speed=2|max,margin=0.1,tolerance=M], "
    "samples:FILE; lengths in m, times in s, angles in degrees"
)


class OptionError(Error):
    """An option is unknown or has an invalid value."""


class Window(NamedTuple):
    begin_s: float
    end_s: float

    def __str__(self) -> str:
        return f"{self.begin_s!r}:{self.end_s!r}"


def window_of(text: str) -> Window:
    begin, _, end = text.partition(":")
    try:
        read = Window(number(begin), number(end))
    except ValueError:
        read = Window(0.0, 0.0)
    if not 0.0 <= read.begin_s < read.end_s:
        raise ArgumentTypeError(f'must be BEGIN:END in s, for example "10:30", not "{text}"')
    return read


def parameter(text: str) -> dict[str, float]:
    """Read NAME=VALUE[,NAME=VALUE...]."""
    try:
        pairs = [pair.partition("=") for pair in text.split(",")]
        return {name.strip(): number(value) for name, _, value in pairs}
    except ValueError:
        raise ArgumentTypeError(f'must be NAME=VALUE, for example "VEH_MASS=0.7", not "{text}"') from None


def merged(given: Iterable[Any]) -> dict[str, float]:
    """Return parameters of one table or several; later values replace earlier ones."""
    tables = [given] if isinstance(given, Mapping) else [parameter(it) if isinstance(it, str) else it for it in given]
    for table in tables:
        if not isinstance(table, Mapping):
            raise OptionError(f'params: must be a table of numbers, not {type(table).__name__} "{shown(table)}"')
        for name, value in table.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise OptionError(f'params: {name} must be a number, not {type(value).__name__} "{shown(value)}"')
    return {str(name): value for table in tables for name, value in table.items()}


@dataclass(frozen=True, kw_only=True)
class VehiclesSpec(WorldSpec, LawSpec):
    """The law and its vehicle, the plant and its world."""

    plant_vehicle: Annotated[
        str | Vehicle | None, Option("vehicle of the plant, to test the law with a wrong model", "NAME")
    ] = None


@dataclass(frozen=True, kw_only=True)
class FlightSpec(VehiclesSpec, GroundSpec):
    """The options of a flight."""

    track: Annotated[Any, Option(TRACK_HELP, "TRACK")]
    params: Annotated[
        tuple[Any, ...],
        Option(
            "set a parameter of control law or vehicle model before the flight; with --gcs, any parameter",
            "NAME=VALUE",
            read=parameter,
            flag="set",
        ),
    ] = ()
    integrator: Annotated[
        Literal["rk4", "adaptive"] | None, Option("integrator of the plant (default: the profile's)")
    ] = None
    link: Annotated[
        Literal["udp", "memory", "direct"],
        Option("udp: two processes; memory: the same flight in one process; direct: also without MAVLink"),
    ] = "memory"
    speed: Annotated[
        float | None, Option("multiple of real time, or max (default: max; 1 with --gcs)", "N", above=0.0, endless=True)
    ] = None
    duration: Annotated[float, Option("simulated time", "S", "s", above=0.0)] = 100.0
    window: Annotated[
        Window | None,
        Option("also report mean, RMS and maximum of the error between these times, s", "BEGIN:END", read=window_of),
    ] = None
    out: Annotated[Path, Option("folder for logs and figures", "DIR", keyword=False)] = Path("out")
    tlog: Annotated[bool, Option("write each MAVLink frame to flight.tlog; always with --gcs", keyword=False)] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "params", merged(self.params))
        if self.window is not None and self.window.begin_s > self.duration:
            raise OptionError(f'window: "{self.window}" begins after the flight, which ends at {self.duration:g} s')
        if not isinstance(self.track, str | Trajectory):
            from colibri.autopilot.guidance.trajectories.sampling import sampled_track  # slow to load

            object.__setattr__(self, "track", sampled_track(self.track, self.duration))

    @classmethod
    def of(cls, track: Any, **options: Any) -> "FlightSpec":
        """Return a flight; options may be Python values or texts of the command line."""
        return from_values(cls, {"track": track, **options}, OptionError)

    @property
    def pace(self) -> float:
        """Times real time to fly."""
        return self.speed or (1.0 if self.gcs else inf)
