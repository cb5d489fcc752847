"""Dryden turbulence as in MIL-F-8785C at low altitude: white noise through shaping filters.

Spectra, one-sided over angular frequency, with V the airspeed:

- Φu(ω) = σu² (2 Lu / π V) / (1 + (Lu ω / V)²)
- Φv and Φw(ω) = σ² (L / π V) (1 + 3 (L ω / V)²) / (1 + (L ω / V)²)²

The filters have variance 1; height and airspeed set their decay rates and the σ that scales them. The discretisation is
exact while these hold. Rotation of the air is left out: a quadrotor's span is small against the eddies.
"""

from math import hypot, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from colibri.common.jit import compiled
from colibri.common.kernels import exp, expm1, power
from colibri.common.types import Array, Vector
from colibri.plant.environment.random_streams import RandomStream
from colibri.plant.environment.weather import Intensity, RecordedWind, Weather, Wind

FEET_PER_M = 1.0 / 0.3048
KNOT_M_S = 1852.0 / 3600.0
W20_KNOTS: dict[Intensity, float] = {"light": 15.0, "moderate": 30.0, "severe": 45.0}  # wind at 20 feet
MIN_HEIGHT_M, MAX_HEIGHT_M = 10.0 / FEET_PER_M, 1000.0 / FEET_PER_M  # the formulas hold between them
MIN_AIRSPEED_M_S = 1.0  # in calm air a hovering vehicle would stay in the same frozen eddy forever

_SQRT_3 = sqrt(3.0)
_BLOCK = 256
_NOISES = 5


Lags: TypeAlias = tuple[float, float, float, float, float]
"""State of the filters: one lag along the mean wind, two in series across it, two upwards."""


class Eddies(NamedTuple):
    frame: int
    lags: Lags


class Scales(NamedTuple):
    """Standard deviations and lengths at one height; `uv` is horizontal."""

    sigma_uv_m_s: float
    sigma_w_m_s: float
    length_uv_m: float
    length_w_m: float


@compiled
def scales(w20_knots: float, height_m: float) -> Scales:
    height_m = min(max(height_m, MIN_HEIGHT_M), MAX_HEIGHT_M)
    slope = 0.177 + 0.000823 * height_m * FEET_PER_M
    sigma_w = 0.1 * w20_knots * KNOT_M_S
    return Scales(sigma_w / power(slope, 0.4), sigma_w, height_m / power(slope, 1.2), height_m)


@compiled
def _twice(x1: float, x2: float, way: float, n1: float, n2: float) -> tuple[float, float]:
    """Advance two equal lags in series, x1' = a (n - x1) and x2' = a (x1 - x2), by a t = `way`.

    The noise has the covariance P - Φ P Φᵀ, with P = [[1, 1/2], [1/2, 1/2]] and Φ = exp(-way) [[1, 0], [way, 1]].
    """
    fade = exp(-way)
    squared = fade * fade
    q11 = -expm1(-2.0 * way)
    q12 = 0.5 * q11 - squared * way
    q22 = 0.5 * q11 - squared * (way * way + way)
    l11 = sqrt(q11)
    l21 = q12 / l11
    l22 = sqrt(max(0.0, q22 - l21 * l21))
    return fade * x1 + l11 * n1, fade * (way * x1 + x2) + l21 * n1 + l22 * n2


@compiled
def _across(x1: float, x2: float) -> float:
    """Return the output (1 + √3 s/a) / (1 + s/a)² of the two lags, scaled to variance 1."""
    return (_SQRT_3 * x1 + (1.0 - _SQRT_3) * x2) / sqrt(2.0)


@compiled
def step(lags: Lags, noise: Array, scale: Scales, airspeed_m_s: float, duration_s: float) -> Lags:
    """Return the lags after a frame with a row of `Turbulence.noise`."""
    u, v1, v2, w1, w2 = lags
    way_m = max(airspeed_m_s, MIN_AIRSPEED_M_S) * duration_s
    along, up = way_m / scale.length_uv_m, way_m / scale.length_w_m
    u = exp(-along) * u + sqrt(-expm1(-2.0 * along)) * noise[0]
    v1, v2 = _twice(v1, v2, along, noise[1], noise[2])
    w1, w2 = _twice(w1, w2, up, noise[3], noise[4])
    return u, v1, v2, w1, w2


@compiled
def add_eddies(velocity: Vector, lags: Lags, scale: Scales, east: float, north: float) -> Vector:
    """Add the velocity of the eddies to another, ENU; `east` and `north`: direction of the mean wind."""
    u, v1, v2, w1, w2 = lags
    along, left, up = scale.sigma_uv_m_s * u, scale.sigma_uv_m_s * _across(v1, v2), scale.sigma_w_m_s * _across(w1, w2)
    x, y, z = velocity
    return x + east * along - north * left, y + north * along + east * left, z + up


@compiled
def _go_on(
    lags: Lags, noise: Array, w20_knots: float, height_m: float, airspeed_m_s: float, duration_s: float,
    velocity: Vector, east: float, north: float,
) -> tuple[Vector, Lags]:  # fmt: skip
    scale = scales(w20_knots, height_m)
    lags = step(lags, noise, scale, airspeed_m_s, duration_s)
    return add_eddies(velocity, lags, scale, east, north), lags


class Turbulence:
    """Random numbers of one seed, by frame."""

    def __init__(self, seed: int) -> None:
        self._key = np.random.SeedSequence(seed, spawn_key=(RandomStream.WEATHER,)).generate_state(2, np.uint64)
        self._block: tuple[int, list[Array]] = (-1, [])

    def begin(self) -> Eddies:
        u, v1, v2, w1, w2 = self.noise(0).tolist()
        return Eddies(1, (u, v1, 0.5 * (v1 + v2), w1, 0.5 * (w1 + w2)))

    def noise(self, frame: int) -> Array:
        """Return five standard normal numbers: one for each lag."""
        block, row = divmod(frame, _BLOCK)
        if self._block[0] != block:
            chance = np.random.Generator(np.random.Philox(key=self._key, counter=block << 128))
            self._block = (block, [*chance.standard_normal((_BLOCK, _NOISES))])
        return self._block[1][row]


CALM: Vector = (0.0, 0.0, 0.0)


class Air:
    def __init__(self, weather: Weather) -> None:
        self._gusts = weather.gusts
        self._w20_knots = None if weather.turbulence is None else W20_KNOTS[weather.turbulence]
        self._turbulence = Turbulence(weather.seed)
        self.steady: Vector | None = None  # velocity, ENU, m/s, where it is constant
        self.blow(weather.wind)
        if self._w20_knots is not None:  # load compiled code before the first frame
            self.go_on(self._turbulence.begin(), 0, 0.0, CALM, 1)

    def blow(self, wind: Wind | RecordedWind) -> None:
        """Replace the mean wind; gusts and turbulence stay."""
        self._wind = wind
        self._mean = wind.velocity_at(0.0) if wind.constant else None
        self.steady = None if self._gusts or self._w20_knots else self._mean

    def begin(self, height_m: float) -> tuple[Vector, Eddies | None]:
        wind = self._mean_at(0.0)
        if self._w20_knots is None:
            return self._with_gusts(wind, 0.0), None
        eddies = self._turbulence.begin()
        scale = scales(self._w20_knots, height_m)
        return add_eddies(self._with_gusts(wind, 0.0), eddies.lags, scale, *_direction(wind)), eddies

    def go_on(
        self, eddies: Eddies | None, time_us: int, height_m: float, velocity_enu_m_s: Vector, duration_us: int
    ) -> tuple[Vector, Eddies | None]:
        """Return velocity, ENU, m/s, and turbulence at the end of a frame that began with `eddies`."""
        time_s = time_us * 1e-6
        wind = self._mean_at(time_s)
        moving = self._with_gusts(wind, time_s)
        if self._w20_knots is None or eddies is None:
            return moving, None
        x, y, z = velocity_enu_m_s
        airspeed, noise = hypot(x - wind[0], y - wind[1], z - wind[2]), self._turbulence.noise(eddies.frame)
        duration_s, (east, north) = duration_us * 1e-6, _direction(wind)
        air, lags = _go_on(eddies.lags, noise, self._w20_knots, height_m, airspeed, duration_s, moving, east, north)
        return air, Eddies(eddies.frame + 1, lags)

    def _mean_at(self, time_s: float) -> Vector:
        return self._mean or self._wind.velocity_at(time_s)

    def _with_gusts(self, velocity: Vector, time_s: float) -> Vector:
        for gust in self._gusts:
            east, north, up = gust.velocity_at(time_s)
            velocity = (velocity[0] + east, velocity[1] + north, velocity[2] + up)
        return velocity


def _direction(wind: Vector) -> tuple[float, float]:
    """Return the direction, east and north; without wind, east."""
    speed = hypot(wind[0], wind[1])
    return (wind[0] / speed, wind[1] / speed) if speed > 0.0 else (1.0, 0.0)
