"""The world's options as texts: wind, gusts, start."""

from argparse import ArgumentTypeError
from collections.abc import Collection
from itertools import pairwise
from math import inf, nan
from pathlib import Path

from colibri.common.errors import unknown
from colibri.common.files import read_given
from colibri.common.process.arguments import number
from colibri.plant.environment.random_streams import NOISES
from colibri.plant.environment.weather import MAX_SPEED_M_S, Gust, RecordedWind, Wind
from colibri.plant.physics.start import Start


def start_values(text: str) -> dict[str, float]:
    return _values(text, Start._fields, -inf, "a number")


def noise_values(text: str) -> dict[str, float]:
    return _values(text, NOISES, 0.0, "a number of at least 0")


def _values(text: str, known: Collection[str], least: float, expected: str) -> dict[str, float]:
    values: dict[str, float] = {}
    for pair in text.split(","):
        key, _, value = pair.partition("=")
        if key not in known:
            raise ArgumentTypeError(unknown("key", key, known))
        try:
            values[key] = number(value)
        except ValueError:
            values[key] = nan
        if not values[key] >= least:
            raise ArgumentTypeError(f"{key}: must be {expected}, not " + (f'"{value}"' if value else "empty"))
    return values


_FULL_TURN_DEG = 360.0
COLUMNS = "t,east,north,up"
GUST = "SPEED@FROM:start=S,duration=S"


def wind(text: str) -> Wind | RecordedWind:
    return recorded_wind(Path(text)) if text.endswith(".csv") else constant_wind(text)


def gust(text: str) -> Gust:
    blows, _, times = text.partition(":")
    peak = constant_wind(blows)
    values = dict(pair.split("=", 1) for pair in times.split(",") if "=" in pair)
    try:
        start_s, duration_s = number(values.pop("start")), number(values.pop("duration"))
    except (KeyError, ValueError):
        raise ArgumentTypeError(f"must be {GUST}, for example 6@270:start=10,duration=2, not {text}") from None
    if values or times.count(",") > 1:
        raise ArgumentTypeError(f"must be {GUST} only, not {text}")
    if start_s < 0.0 or duration_s <= 0.0:
        raise ArgumentTypeError(f"the start must not be negative, the duration above zero, not {text}")
    return Gust(peak, start_s, duration_s)


def recorded_wind(path: Path) -> RecordedWind:
    lines = read_given(path, ArgumentTypeError).splitlines()
    if not lines or lines[0].replace(" ", "") != COLUMNS:
        raise ArgumentTypeError(f"{path}: line 1: must be {COLUMNS}")
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
        raise ArgumentTypeError(f"{path}: line {line}: must be four numbers, {COLUMNS}") from None
    if max(abs(east), abs(north), abs(up)) > MAX_SPEED_M_S:
        raise ArgumentTypeError(f"{path}: line {line}: no wind is faster than {MAX_SPEED_M_S:g} m/s")
    return line, (t, east, north, up)


def constant_wind(text: str) -> Wind:
    speed, _, direction = text.partition("@")
    try:
        value = Wind(number(speed), number(direction))
    except ValueError:
        raise ArgumentTypeError(f"must be SPEED@FROM in m/s and degrees, for example 5@270, not {text}") from None
    if value.speed_m_s < 0.0 or not 0.0 <= value.from_deg <= _FULL_TURN_DEG:
        raise ArgumentTypeError(f"the speed must not be negative, the direction 0 to 360 degrees, not {text}")
    if value.speed_m_s > MAX_SPEED_M_S:
        raise ArgumentTypeError(f"no wind is faster than {MAX_SPEED_M_S:g} m/s, not {text}")
    return value
