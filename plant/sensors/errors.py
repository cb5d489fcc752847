"""How sensors err: processes driven by a stream of standard normal numbers, exact at any interval."""

from math import sqrt

import numpy as np

from colibri.common.kernels import exp
from colibri.common.types import Vector
from colibri.plant.environment.random_streams import Chance

_DRAWN = 128
"""Samples whose errors are drawn at once."""


class GaussMarkov:
    """A drift that forgets: first-order, of constant variance, x' = -x / T + w.

    After Δ it is x exp(-Δ / T) plus chance of variance σ² (1 - exp(-2 Δ / T)).
    """

    def __init__(self, deviation: float, time_s: float, chance: Chance) -> None:
        """Begin somewhere in the stationary distribution of σ = `deviation`, with T = `time_s`."""
        self._deviation = deviation
        self._time_s = time_s
        self._chance = chance
        self.value = deviation * next(chance)

    def after(self, elapsed_s: float) -> float:
        """Return the drift so much later."""
        kept = exp(-elapsed_s / self._time_s)
        self.value = kept * self.value + self._deviation * sqrt(1.0 - kept * kept) * next(self._chance)
        return self.value


class Triad:
    """Three axes of white noise on a bias that walks at random, sampled at an interval, cut at the sensor's range.

    White noise is that of a mean over the interval, density / √interval (IEEE Std 952, annex C).

    Attributes:
        bias: As it is switched on.
    """

    def __init__(
        self, density: float, walk: float, turn_on: float, limit: float, interval_s: float, chance: Chance
    ) -> None:
        """Switch on.

        Args:
            density: White noise, units / √Hz.
            walk: Of the bias, units / s / √Hz.
            turn_on: Standard deviation of the bias at the start, units.
            limit: What is larger is cut, units.
            interval_s: Between two samples.
            chance: Standard normal numbers.
        """
        self._limit = limit
        self._chance = chance
        self._walk, self._noise = walk * sqrt(interval_s), density / sqrt(interval_s)
        self.bias: Vector = (turn_on * next(chance), turn_on * next(chance), turn_on * next(chance))
        self._last = np.array(self.bias)
        self._drawn: list[list[float]] = []

    def measure(self, truth: Vector) -> Vector:
        """Return the sample of `truth`, one interval after the one before."""
        limit = self._limit
        if not self._drawn:
            self.draw()
        bx, by, bz, dx, dy, dz = self._drawn.pop()
        x, y, z = bx + (truth[0] + dx), by + (truth[1] + dy), bz + (truth[2] + dz)
        if -limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit:
            return (x, y, z)
        return (min(max(x, -limit), limit), min(max(y, -limit), limit), min(max(z, -limit), limit))

    def draw(self, left: int = 0) -> None:
        """Have bias and white noise of samples to come, of many at once, where no more than `left` are still drawn."""
        if len(self._drawn) > left:
            return
        drawn = np.array(self._chance.take(6 * _DRAWN)).reshape(_DRAWN, 6)
        biases = np.add.accumulate(np.concatenate([self._last[None], self._walk * drawn[:, :3]]))[1:]
        self._last = biases[-1]
        later: list[list[float]] = np.concatenate([biases, self._noise * drawn[:, 3:]], axis=1)[::-1].tolist()
        self._drawn = later + self._drawn
