"""Independent streams of random numbers, one per consumer: a change to one leaves the others as they are."""

from collections.abc import Iterator, Mapping
from enum import IntEnum

import numpy as np
from numpy.random import SeedSequence, default_rng

from colibri.common.types import PerRotor, Vector

_BLOCK = 1024


class RandomStream(IntEnum):
    SENSORS = 0
    WEATHER = 1
    FAULTS = 2
    NOISE = 3


class Chance:
    """Standard normal numbers of 24 bits: beyond, NumPy's tail depends on the computer's libm."""

    def __init__(self, seed: SeedSequence) -> None:
        self._left: list[float] = []  # drawn, the next one last
        self.begin(seed)

    def begin(self, seed: SeedSequence) -> None:
        self._generator = default_rng(seed)
        self._left.clear()

    def __iter__(self) -> Iterator[float]:
        return self

    def __next__(self) -> float:
        if not self._left:
            self._draw()
        return self._left.pop()

    def take(self, count: int) -> list[float]:
        taken: list[float] = []
        while len(taken) < count:
            if not self._left:
                self._draw()
            first = max(0, len(self._left) - (count - len(taken)))
            taken += self._left[: first - 1 if first else None : -1]
            del self._left[first:]
        return taken

    def _draw(self) -> None:
        self._left = self._generator.standard_normal(_BLOCK).astype(np.float32).tolist()[::-1]


def seeds(seed: int, source: RandomStream, count: int) -> list[SeedSequence]:
    return SeedSequence(seed, spawn_key=(source,)).spawn(count)


def streams(seed: int, source: RandomStream, count: int) -> list[Chance]:
    return [Chance(child) for child in seeds(seed, source, count)]


_ROTORS = 8  # the most of a vehicle
NOISES = ("force", "moment", "motors")  # N, N m, and parts of each rotor's command, for each root of hertz


class Noise:
    """Process and motor noise, held over each frame: a density d has the standard deviation d / √(frame's duration)."""

    def __init__(self, densities: Mapping[str, float], seed: int) -> None:
        force, moment, motors = (densities.get(name, 0.0) for name in NOISES)
        self._densities = np.array([force] * 3 + [moment] * 3 + [motors] * _ROTORS)
        self._key = np.random.SeedSequence(seed, spawn_key=(RandomStream.NOISE,)).generate_state(2, np.uint64)

    def over(self, time_us: int, duration_us: int) -> tuple[Vector, Vector, PerRotor]:
        """Return force, N, and moment, N m, on the body, FLU, and factors of 8 rotors' commands, from `time_us` on."""
        chance = np.random.Generator(np.random.Philox(key=self._key, counter=time_us << 64))
        normal = chance.standard_normal(len(self._densities)).astype(np.float32)  # as in `random_streams.Chance`
        fx, fy, fz, mx, my, mz, *motors = (self._densities * normal / (duration_us * 1e-6) ** 0.5).tolist()
        return (fx, fy, fz), (mx, my, mz), tuple([1.0 + part for part in motors])
