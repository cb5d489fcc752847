"""The interface of a sensor: the true world in, its output at that frame out."""

from collections.abc import Callable
from math import sqrt
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from colibri.common.earth.geodesy import Geodetic
from colibri.common.kernels import exp
from colibri.common.types import Vector
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.world import Physics, World

Measure: TypeAlias = Callable[[World], Any]  # the world at each frame -> a sensor's output; None without a new one

_ROUNDING = 1e-9


def vector_sum(value: Vector, error: Vector) -> Vector:
    return (value[0] + error[0], value[1] + error[1], value[2] + error[2])


class SensorSurroundings(NamedTuple):
    physics: Physics
    origin: Geodetic
    interval_s: float


class Instrument(NamedTuple):
    """A sensor that a vehicle may have."""

    part: str  # its table in the vehicle file
    field: str  # of `SensorFrame`
    group: int  # bit of `Updated` if the field keeps its last output; 0 if it is None between outputs
    unit: int  # FAILURE_UNIT
    switched_on: Callable[[Any, SensorSurroundings, Chance], Measure]
    add: Callable[[Any, Vector], Any] = vector_sum  # (value, error of a fault) -> erroneous value
    at: Callable[[Any, int], Any] = lambda value, _: value  # (value, time in µs) -> value with that time stamp


class Rate:
    """Samples at the first frame at or after each multiple of its interval."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_mhz = rate_hz * 1e-6
        self._samples = -1

    def is_due(self, time_us: int) -> bool:
        """Return whether there is a sample; call it once a frame."""
        samples = int(time_us * self._rate_mhz + _ROUNDING)
        due = samples > self._samples
        self._samples = samples
        return due


_DRAWN = 128  # samples whose errors are drawn at once


class GaussMarkov:
    """A first-order Gauss-Markov drift: after Δ, x exp(-Δ / T) plus noise of variance σ² (1 - exp(-2 Δ / T))."""

    def __init__(self, deviation: float, time_s: float, chance: Chance) -> None:
        self._deviation, self._time_s, self._chance = deviation, time_s, chance
        self._last_us: int | None = None
        self.value = deviation * next(chance)

    def after(self, elapsed_s: float) -> float:
        kept = exp(-elapsed_s / self._time_s)
        self.value = kept * self.value + self._deviation * sqrt(1.0 - kept * kept) * next(self._chance)
        return self.value

    def at(self, time_us: int) -> float:
        if self._last_us is not None:
            self.after((time_us - self._last_us) * 1e-6)
        self._last_us = time_us
        return self.value


class Triad:
    """Three axes of white noise on a random-walk bias, clipped at the sensor's range.

    `density` is in units / √Hz, `walk` in units / s / √Hz; `turn_on` is the bias's standard deviation. White noise is a
    mean over the interval, density / √interval (IEEE Std 952, annex C).
    """

    def __init__(
        self, density: float, walk: float, turn_on: float, limit: float, interval_s: float, chance: Chance
    ) -> None:
        self._limit, self._chance = limit, chance
        self._walk, self._noise = walk * sqrt(interval_s), density / sqrt(interval_s)
        self.bias: Vector = (turn_on * next(chance), turn_on * next(chance), turn_on * next(chance))
        self._last = np.array(self.bias)
        self._drawn: list[list[float]] = []

    def measure(self, truth: Vector) -> Vector:
        limit = self._limit
        if not self._drawn:
            self._draw()
        bx, by, bz, dx, dy, dz = self._drawn.pop()
        x, y, z = bx + (truth[0] + dx), by + (truth[1] + dy), bz + (truth[2] + dz)
        if abs(x) <= limit and abs(y) <= limit and abs(z) <= limit:
            return (x, y, z)
        return (min(max(x, -limit), limit), min(max(y, -limit), limit), min(max(z, -limit), limit))

    def _draw(self) -> None:
        drawn = np.array(self._chance.take(6 * _DRAWN)).reshape(_DRAWN, 6)
        biases = np.add.accumulate(np.concatenate([self._last[None], self._walk * drawn[:, :3]]))[1:]
        self._last = biases[-1]
        self._drawn = np.concatenate([biases, self._noise * drawn[:, 3:]], axis=1)[::-1].tolist()
