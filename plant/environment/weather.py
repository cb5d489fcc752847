"""The weather of a flight: wind, gusts, turbulence. Velocities of the air are ENU, m/s."""

from bisect import bisect_right
from dataclasses import dataclass
from math import pi, radians
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from colibri.common.elementary import cos, sin
from colibri.common.types import Vector

Intensity: TypeAlias = Literal["light", "moderate", "severe"]

INTENSITIES: tuple[Intensity, ...] = ("light", "moderate", "severe")
MAX_SPEED_M_S = 150.0  # above any wind recorded on the ground


class Wind(NamedTuple):
    """A constant wind; `from_deg` is clockwise from north, 270 blows from west to east."""

    speed_m_s: float
    from_deg: float

    @property
    def velocity_enu_m_s(self) -> Vector:
        direction = radians(self.from_deg)
        return (-self.speed_m_s * sin(direction), -self.speed_m_s * cos(direction), 0.0)

    @property
    def constant(self) -> bool:
        return True

    def velocity_at(self, _time_s: float) -> Vector:
        return self.velocity_enu_m_s

    def __str__(self) -> str:
        return f"{self.speed_m_s!r}@{self.from_deg!r}"


@dataclass(frozen=True, slots=True)
class RecordedWind:
    """A wind from a file: linear between its times, constant before the first and after the last."""

    path: Path
    times_s: tuple[float, ...]
    velocities_enu_m_s: tuple[Vector, ...]

    @property
    def constant(self) -> bool:
        return len(self.times_s) == 1

    def velocity_at(self, time_s: float) -> Vector:
        after = bisect_right(self.times_s, time_s)
        if after in (0, len(self.times_s)):
            return self.velocities_enu_m_s[max(0, after - 1)]
        began_s, ends_s = self.times_s[after - 1 : after + 1]
        a, b = self.velocities_enu_m_s[after - 1 : after + 1]
        part = (time_s - began_s) / (ends_s - began_s)
        return (a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2]))

    def __str__(self) -> str:
        return str(self.path)


class Gust(NamedTuple):
    """A discrete gust, V/2 (1 - cos 2π(t - start)/duration), with `wind` its peak V."""

    wind: Wind
    start_s: float
    duration_s: float

    def velocity_at(self, time_s: float) -> Vector:
        phase = (time_s - self.start_s) / self.duration_s
        if not 0.0 < phase < 1.0:
            return (0.0, 0.0, 0.0)
        share = 0.5 * (1.0 - cos(2.0 * pi * phase))
        east, north, up = self.wind.velocity_enu_m_s
        return (share * east, share * north, share * up)

    def __str__(self) -> str:
        return f"{self.wind}:start={self.start_s!r},duration={self.duration_s!r}"


class Weather(NamedTuple):
    """All movement of the air; `seed` chooses the turbulence."""

    wind: Wind | RecordedWind
    gusts: tuple[Gust, ...] = ()
    turbulence: Intensity | None = None
    seed: int = 0


NO_WIND = Wind(0.0, 0.0)
NO_WEATHER = Weather(NO_WIND)
