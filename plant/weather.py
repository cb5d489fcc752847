"""The weather that a flight is flown in, as the command line says it: wind, gusts, turbulence.

Velocities are those of the air, ENU, m/s. `plant.air` makes it blow.
"""

from argparse import ArgumentTypeError, Namespace
from bisect import bisect_right
from itertools import pairwise
from math import pi, radians
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from common.elementary import cos, sin
from mavlink.frames import Vector
from mavlink.process import ArgumentParser, number

Intensity: TypeAlias = Literal["light", "moderate", "severe"]

INTENSITIES: tuple[Intensity, ...] = ("light", "moderate", "severe")
FASTEST_M_S = 150.0
"""No wind on Earth's ground was ever faster."""

_FULL_TURN_DEG = 360.0
_COLUMNS = "t,east,north,up"
_GUST = "SPEED@FROM:start=S,duration=S"


class Wind(NamedTuple):
    """A constant wind, as meteorology says it.

    Attributes:
        speed_m_s: Speed.
        from_deg: Where it blows from, degrees clockwise from north: 270 blows from west to east.
    """

    speed_m_s: float
    from_deg: float

    @property
    def velocity_enu_m_s(self) -> Vector:
        """Velocity of the air."""
        direction = radians(self.from_deg)
        return (-self.speed_m_s * sin(direction), -self.speed_m_s * cos(direction), 0.0)

    @property
    def constant(self) -> bool:
        """Whether it is always the same."""
        return True

    def velocity_at(self, _time_s: float) -> Vector:
        """Return the velocity of the air at a time."""
        return self.velocity_enu_m_s

    def __str__(self) -> str:
        """Return what `wind` reads back."""
        return f"{self.speed_m_s!r}@{self.from_deg!r}"


class RecordedWind(NamedTuple):
    """A wind from a file: linear between its times, constant before the first and after the last.

    Attributes:
        path: The file.
        times_s: Simulated time, rising.
        velocities_enu_m_s: One for each time.
    """

    path: Path
    times_s: tuple[float, ...]
    velocities_enu_m_s: tuple[Vector, ...]

    @property
    def constant(self) -> bool:
        """Whether it is always the same."""
        return len(self.times_s) == 1

    def velocity_at(self, time_s: float) -> Vector:
        """Return the velocity of the air at a time."""
        after = bisect_right(self.times_s, time_s)
        if after in (0, len(self.times_s)):
            return self.velocities_enu_m_s[max(0, after - 1)]
        began_s, ends_s = self.times_s[after - 1 : after + 1]
        a, b = self.velocities_enu_m_s[after - 1 : after + 1]
        part = (time_s - began_s) / (ends_s - began_s)
        return (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2]))

    def __str__(self) -> str:
        """Return what `wind` reads back."""
        return str(self.path)


class Gust(NamedTuple):
    """A discrete gust that comes on and dies away as V/2 (1 - cos 2π(t - start)/duration).

    Attributes:
        wind: Its peak, V.
        start_s: Simulated time at which it begins.
        duration_s: How long it lasts; the peak is in the middle.
    """

    wind: Wind
    start_s: float
    duration_s: float

    def velocity_at(self, time_s: float) -> Vector:
        """Return the velocity that it adds to the air at a time."""
        phase = (time_s - self.start_s) / self.duration_s
        if not 0.0 < phase < 1.0:
            return (0.0, 0.0, 0.0)
        share = 0.5 * (1.0 - cos(2.0 * pi * phase))
        east, north, up = self.wind.velocity_enu_m_s
        return (share * east, share * north, share * up)

    def __str__(self) -> str:
        """Return what `gust` reads back."""
        return f"{self.wind}:start={self.start_s!r},duration={self.duration_s!r}"


class Weather(NamedTuple):
    """All that moves the air.

    Attributes:
        wind: The mean wind.
        gusts: What is added to it.
        turbulence: How strong it is; None for none.
        seed: Of the turbulence.
    """

    wind: Wind | RecordedWind
    gusts: tuple[Gust, ...] = ()
    turbulence: Intensity | None = None
    seed: int = 0

    def options(self) -> list[str]:
        """Return the command line that `add_weather_arguments` reads back; `--seed` is not only the weather's."""
        return [
            *("--wind", str(self.wind)),
            *(f"--gust={gust}" for gust in self.gusts),
            *(("--turbulence", self.turbulence) if self.turbulence else ()),
        ]


NO_WIND = Wind(0.0, 0.0)
NO_WEATHER = Weather(NO_WIND)


def wind(text: str) -> Wind | RecordedWind:
    """Read a wind of the command line: `SPEED@FROM`, or a file if it ends in `.csv`."""
    return recorded_wind(Path(text)) if text.endswith(".csv") else _constant(text)


def gust(text: str) -> Gust:
    """Read a gust of the command line, `SPEED@FROM:start=S,duration=S`."""
    blows, _, times = text.partition(":")
    peak = _constant(blows)
    values = dict(pair.split("=", 1) for pair in times.split(",") if "=" in pair)
    try:
        start_s, duration_s = number(values.pop("start")), number(values.pop("duration"))
    except (KeyError, ValueError):
        raise ArgumentTypeError(f"must be {_GUST}, 6@270:start=10,duration=2 say, not {text}") from None
    if values or times.count(",") > 1:
        raise ArgumentTypeError(f"must be {_GUST} and nothing else, not {text}")
    if start_s < 0.0 or duration_s <= 0.0:
        raise ArgumentTypeError(f"the start must not be negative, the duration above zero, not {text}")
    return Gust(peak, start_s, duration_s)


def recorded_wind(path: Path) -> RecordedWind:
    """Read a wind from a CSV file with a header of t,east,north,up: s and m/s.

    Raises:
        ArgumentTypeError: The file cannot be read, or is none; the message names file, line and what is wrong.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as reason:
        raise ArgumentTypeError(f"{path}: {reason.strerror}") from reason
    except ValueError as reason:
        raise ArgumentTypeError(f"{path}: {reason}") from reason
    if not lines or lines[0].replace(" ", "") != _COLUMNS:
        raise ArgumentTypeError(f"{path}: line 1: must be {_COLUMNS}")
    rows = [_row(path, i, line) for i, line in enumerate(lines[1:], start=2) if line.strip()]
    if not rows:
        raise ArgumentTypeError(f"{path}: line {len(lines)}: the file ends, and a wind needs a row")
    for (_, (before, *_)), (line, (after, *_)) in pairwise(rows):
        if after <= before:
            raise ArgumentTypeError(f"{path}: line {line}: t must rise, and {after:g} is not after {before:g}")
    return RecordedWind(path, tuple(row[0] for _, row in rows), tuple(row[1:] for _, row in rows))


def _row(path: Path, line: int, text: str) -> tuple[int, tuple[float, float, float, float]]:
    try:
        t, east, north, up = map(number, text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"{path}: line {line}: must be four numbers, {_COLUMNS}") from None
    if max(abs(east), abs(north), abs(up)) > FASTEST_M_S:
        raise ArgumentTypeError(f"{path}: line {line}: no wind is faster than {FASTEST_M_S:g} m/s")
    return line, (t, east, north, up)


def _constant(text: str) -> Wind:
    speed, _, direction = text.partition("@")
    try:
        value = Wind(number(speed), number(direction))
    except ValueError:
        raise ArgumentTypeError(f"must be SPEED@FROM in m/s and degrees, 5@270 say, not {text}") from None
    if value.speed_m_s < 0.0 or not 0.0 <= value.from_deg <= _FULL_TURN_DEG:
        raise ArgumentTypeError(f"the speed must not be negative, the direction 0 to 360 degrees, not {text}")
    if value.speed_m_s > FASTEST_M_S:
        raise ArgumentTypeError(f"no wind is faster than {FASTEST_M_S:g} m/s, not {text}")
    return value


def weather_of(args: Namespace) -> Weather:
    """Return the weather that a command line asks for."""
    return Weather(args.wind, tuple(args.gust), args.turbulence, args.seed)


def add_weather_arguments(parser: ArgumentParser) -> None:
    """Add `--wind`, `--gust` and `--turbulence`."""
    add = parser.add_argument
    add(
        "--wind",
        type=wind,
        default=NO_WIND,
        metavar="SPEED@FROM|FILE",
        help="m/s, and degrees it blows from, clockwise from north: 5@270 blows from west to east; or a .csv file with "
        f"a header of {_COLUMNS} (s, m/s), linear in between (default: calm)",
    )
    add(
        "--gust",
        type=gust,
        action="append",
        default=[],
        metavar=_GUST,
        help="a gust on top of it, of the shape 1 - cosine; may be repeated",
    )
    add(
        "--turbulence",
        choices=INTENSITIES,
        help="Dryden's, as MIL-F-8785C has it at low altitude, on top of it; --seed makes another of the same kind "
        "(default: none)",
    )
