"""How the air moves where the vehicle is: mean wind, gusts and turbulence, held over each frame."""

from math import hypot

from mavlink.frames import Vector
from plant.turbulence import Eddies, Turbulence
from plant.weather import Weather

CALM: Vector = (0.0, 0.0, 0.0)


class Air:
    """The air of one weather: (what it remembers, where the vehicle is) -> velocity.

    Attributes:
        steady: Its velocity, ENU, m/s, where that is always the same; None where it changes.
    """

    def __init__(self, weather: Weather) -> None:
        """Blow as `weather` says."""
        self._wind = weather.wind
        self._gusts = weather.gusts
        self._turbulence = None if weather.turbulence is None else Turbulence(weather.turbulence, weather.seed)
        changes = weather.gusts or self._turbulence or not weather.wind.constant
        self.steady: Vector | None = None if changes else weather.wind.velocity_at(0.0)

    def begin(self, height_m: float) -> tuple[Vector, Eddies | None]:
        """Return the air's velocity at time 0, ENU, m/s, and its eddies."""
        eddies = self._turbulence.begin() if self._turbulence else None
        return self._velocity(0.0, height_m, eddies), eddies

    def go_on(
        self, eddies: Eddies | None, time_us: int, height_m: float, velocity_enu_m_s: Vector, duration_us: int
    ) -> tuple[Vector, Eddies | None]:
        """Return the air's velocity, ENU, m/s, and its eddies, at the end of a frame.

        Args:
            eddies: At its beginning.
            time_us: Simulated time of its end.
            height_m: Of the vehicle above ground.
            velocity_enu_m_s: Of the vehicle.
            duration_us: Of the frame.
        """
        if self._turbulence and eddies:
            wind = self._wind.velocity_at((time_us - duration_us) * 1e-6)
            airspeed = hypot(*(own - air for own, air in zip(velocity_enu_m_s, wind, strict=True)))
            eddies = self._turbulence.step(eddies, airspeed, height_m, duration_us * 1e-6)
        return self._velocity(time_us * 1e-6, height_m, eddies), eddies

    def _velocity(self, time_s: float, height_m: float, eddies: Eddies | None) -> Vector:
        east, north, up = mean_east, mean_north, _ = self._wind.velocity_at(time_s)
        for gust in self._gusts:
            more_east, more_north, more_up = gust.velocity_at(time_s)
            east, north, up = east + more_east, north + more_north, up + more_up
        if self._turbulence and eddies:
            along, left, upwards = self._turbulence.velocity_m_s(eddies, height_m)
            speed = hypot(mean_east, mean_north)
            e, n = (mean_east / speed, mean_north / speed) if speed > 0.0 else (1.0, 0.0)
            east, north, up = east + e * along - n * left, north + n * along + e * left, up + upwards
        return (east, north, up)
