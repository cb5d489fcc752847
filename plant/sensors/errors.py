"""How sensors err: processes driven by a stream of standard normal numbers, exact at any interval."""

from collections.abc import Iterator
from math import sqrt

from colibri.common.kernels import exp
from colibri.common.types import Vector


class GaussMarkov:
    """A drift that forgets: first-order, of constant variance, x' = -x / T + w.

    After Δ it is x exp(-Δ / T) plus chance of variance σ² (1 - exp(-2 Δ / T)).
    """

    def __init__(self, deviation: float, time_s: float, chance: Iterator[float]) -> None:
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
    """

    def __init__(
        self, density: float, walk: float, turn_on: float, limit: float, interval_s: float, chance: Iterator[float]
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
        self._noise = density / sqrt(interval_s)
        self._walk = walk * sqrt(interval_s)
        self._limit = limit
        self._chance = chance
        self.bias: Vector = (turn_on * next(chance), turn_on * next(chance), turn_on * next(chance))

    def measure(self, truth: Vector) -> Vector:
        """Return the sample of `truth`, one interval after the one before."""
        chance, noise, walk, limit = self._chance, self._noise, self._walk, self._limit
        x = self.bias[0] + walk * next(chance)
        y = self.bias[1] + walk * next(chance)
        z = self.bias[2] + walk * next(chance)
        self.bias = (x, y, z)
        x += truth[0] + noise * next(chance)
        y += truth[1] + noise * next(chance)
        z += truth[2] + noise * next(chance)
        return (min(max(x, -limit), limit), min(max(y, -limit), limit), min(max(z, -limit), limit))
