"""Chance: one stream of random numbers for each thing that has any, so that none changes another's."""

from collections.abc import Iterator
from enum import IntEnum
from itertools import chain

import numpy as np
from numpy.random import SeedSequence, default_rng

_BLOCK = 1024


class Source(IntEnum):
    """What has streams of its own, however many others there are."""

    SENSORS = 0
    WEATHER = 1
    FAULTS = 2


def streams(seed: int, source: Source, count: int) -> list[Iterator[float]]:
    """Return independent streams of standard normal numbers; the same for the same `seed` (not negative)."""
    return [chain.from_iterable(_blocks(child)) for child in SeedSequence(seed, spawn_key=(source,)).spawn(count)]


def _blocks(seed: SeedSequence) -> Iterator[list[float]]:
    """Yield numbers of 24 bits: NumPy takes the rare ones of the tail from libm, whose last bit differs by computer."""
    generator = default_rng(seed)
    while True:
        yield generator.standard_normal(_BLOCK).astype(np.float32).tolist()
