"""Options of the plant, its world and its start."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Annotated, Any, Literal, TypeAlias, get_args

from colibri.common.earth.home import DEFAULT_HOME, HomePlace
from colibri.common.earth.home import home as read_home
from colibri.common.process.spec import ProcessSpec
from colibri.common.spec import Option
from colibri.plant.environment.random_streams import Noise
from colibri.plant.environment.weather import NO_WIND, Gust, Intensity, RecordedWind, Weather, Wind
from colibri.plant.events import EVENT, FORMS, event, events_of
from colibri.plant.physics.start import Start
from colibri.plant.texts import COLUMNS, GUST, gust, noise_values, start_values
from colibri.plant.texts import wind as read_wind
from colibri.plant.vehicle.description import Vehicle

Part: TypeAlias = Literal["rotor-lag", "drag", "ground", "battery"]
PARTS: tuple[Part, ...] = get_args(Part)


@dataclass(frozen=True, kw_only=True)
class WorldSpec:
    """The world of a flight."""

    without: Annotated[
        tuple[Part, ...], Option("leave out a part of the plant's model; the autopilot's model keeps it")
    ] = ()
    wind: Annotated[
        Wind | RecordedWind,
        Option(
            "wind speed, m/s, and direction that it blows from, degrees clockwise from north: 5@270 is from the west; "
            f"or a .csv file with header {COLUMNS} (s, m/s), interpolated linearly (default: calm)",
            "SPEED@FROM|FILE",
            read=read_wind,
        ),
    ] = NO_WIND
    gusts: Annotated[
        tuple[Gust, ...], Option("add a gust of shape 1 - cosine to the wind", GUST, read=gust, flag="gust")
    ] = ()
    turbulence: Annotated[
        Intensity | None, Option("add Dryden turbulence to the wind, by MIL-F-8785C at low altitude; random by --seed")
    ] = None
    noise: Annotated[
        Mapping[str, float],
        Option(
            "white noise of force (N) and moment (N m) on the body, and of motors (fraction of the command), per root "
            "of hertz, constant within a frame: force=0.1 is 1.6 N RMS at 250 Hz; random by --seed",
            "KEY=VALUE,...",
            read=noise_values,
        ),
    ] = field(default_factory=dict)
    events: Annotated[
        tuple[Any, ...],
        Option(
            f"event at T seconds: {FORMS} (the last two need ground stations); or a file with tables [[events]]",
            EVENT,
            read=event,
            flag="event",
        ),
    ] = ()
    seed: Annotated[int, Option("seed of all random numbers", "N", least=0)] = 0
    start: Annotated[
        Mapping[str, float],
        Option(
            "initial values: x, y, z (m, ENU), phi, theta, psi (degrees), vx, vy, vz (m/s, ENU), p, q, r (rad/s, FLU), "
            "rotors (rpm)",
            "KEY=VALUE,...",
            read=start_values,
        ),
    ] = field(default_factory=dict)
    latency: Annotated[
        float,
        Option(
            "simulated one-way latency between plant and autopilot: a command takes effect two latencies after its "
            "frame, and the previous one holds until then",
            "MS",
            "ms",
            least=0.0,
            most=1000.0,
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        if self.events:
            object.__setattr__(self, "events", events_of(self.events, getattr(self, "duration", inf)))

    @property
    def weather(self) -> Weather:
        """Wind, gusts and turbulence."""
        return Weather(self.wind, self.gusts, self.turbulence, self.seed)

    @property
    def disturbance(self) -> Noise | None:
        """The plant's noise, if any."""
        return Noise(self.noise, self.seed) if any(self.noise.values()) else None

    def started(self, usual: Start) -> Start:
        """Return `usual` with the given values replaced."""
        return usual._replace(**self.start)


@dataclass(frozen=True, kw_only=True)
class PlantSpec(WorldSpec, ProcessSpec):
    """A plant as a process."""

    serve: Annotated[
        Literal["colibri", "ardupilot-json", "px4"],
        Option(
            "autopilot to serve: colibri (default); ardupilot-json: ArduPilot's SITL, started with --model JSON, which "
            "sets rate and speed; px4: PX4's SITL over TCP, or over UDP with --link udpout:HOST:PORT"
        ),
    ] = "colibri"
    link: Annotated[str | None, Option("link on which to wait for the autopilot", "URL")] = None
    vehicle: Annotated[str | Vehicle, Option("vehicle name or .toml", "NAME")] = "hummingbird"
    integrator: Annotated[
        Literal["rk4", "adaptive"], Option("rk4: fixed steps of 1 ms (default); adaptive: Dormand-Prince to 1e-9")
    ] = "rk4"
    home: Annotated[HomePlace, Option("origin, degrees and m", "LAT,LON,ALT,YAW", read=read_home)] = DEFAULT_HOME
    rate: Annotated[float, Option("frame rate, unless the autopilot requests another", "HZ", "Hz", above=0.0)] = 250.0
    realtime: Annotated[
        bool, Option("follow the wall clock as hardware does: wait for no answer, and hold the last command")
    ] = False
    cut_after: Annotated[
        float, Option("with --realtime: stop the rotors after this time without a command", "S", "s", above=0.0)
    ] = 0.5
    duration: Annotated[
        float, Option("end after this simulated time (default: never)", "S", "s", above=0.0, endless=True)
    ] = inf
    speed: Annotated[
        float | None, Option("multiple of real time (default: max; with --realtime 1)", "N", above=0.0, endless=True)
    ] = None
    tlog: Annotated[bool, Option("also write each MAVLink frame to flight.tlog in --out")] = False
    truth: Annotated[bool, Option("for tests: append the true state to each frame of sensors")] = False

    @property
    def pace(self) -> float:
        """Speed, times real time."""
        return self.speed or (1.0 if self.realtime else inf)
