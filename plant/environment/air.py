"""Velocity of the air at the vehicle: mean wind, gusts and turbulence, held over each frame."""

from math import hypot

from colibri.common.types import Vector
from colibri.plant.environment.turbulence import Eddies, Scales, Turbulence, eddy_velocity, scales
from colibri.plant.environment.weather import RecordedWind, Weather, Wind

CALM: Vector = (0.0, 0.0, 0.0)


class Air:
    """The air of one weather."""

    def __init__(self, weather: Weather) -> None:
        self._gusts = weather.gusts
        self._intensity = weather.turbulence
        self._turbulence = Turbulence(weather.seed)
        self.steady: Vector | None = None  # velocity, ENU, m/s, where it is constant
        self.blow(weather.wind)

    def blow(self, wind: Wind | RecordedWind) -> None:
        """Replace the mean wind; gusts and turbulence stay."""
        self._wind = wind
        self._mean = wind.velocity_at(0.0) if wind.constant else None
        self.steady = None if self._gusts or self._intensity else self._mean

    def begin(self, height_m: float) -> tuple[Vector, Eddies | None]:
        wind = self._mean_at(0.0)
        if self._intensity is None:
            return self._with_gusts(wind, 0.0), None
        eddies = self._turbulence.begin()
        return _with_eddies(self._with_gusts(wind, 0.0), wind, eddies, scales(self._intensity, height_m)), eddies

    def go_on(
        self, eddies: Eddies | None, time_us: int, height_m: float, velocity_enu_m_s: Vector, duration_us: int
    ) -> tuple[Vector, Eddies | None]:
        """Return velocity, ENU, m/s, and turbulence at the end of a frame that began with `eddies`."""
        time_s = time_us * 1e-6
        wind = self._mean_at(time_s)
        moving = self._with_gusts(wind, time_s)
        if self._intensity is None or eddies is None:
            return moving, None
        scale = scales(self._intensity, height_m)
        x, y, z = velocity_enu_m_s
        airspeed = hypot(x - wind[0], y - wind[1], z - wind[2])
        eddies = self._turbulence.step(eddies, scale, airspeed, duration_us * 1e-6)
        return _with_eddies(moving, wind, eddies, scale), eddies

    def _mean_at(self, time_s: float) -> Vector:
        return self._mean or self._wind.velocity_at(time_s)

    def _with_gusts(self, velocity: Vector, time_s: float) -> Vector:
        for gust in self._gusts:
            east, north, up = gust.velocity_at(time_s)
            velocity = (velocity[0] + east, velocity[1] + north, velocity[2] + up)
        return velocity


def _with_eddies(velocity: Vector, wind: Vector, eddies: Eddies, scale: Scales) -> Vector:
    along, left, up = eddy_velocity(eddies, scale)
    speed = hypot(wind[0], wind[1])
    e, n = (wind[0] / speed, wind[1] / speed) if speed > 0.0 else (1.0, 0.0)
    return (velocity[0] + e * along - n * left, velocity[1] + n * along + e * left, velocity[2] + up)
