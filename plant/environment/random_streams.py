"""Independent streams of random numbers, one per consumer: a change to one leaves the others as they are."""

from collections.abc import Iterator
from enum import IntEnum

import numpy as np
from numpy.random import SeedSequence, default_rng

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
