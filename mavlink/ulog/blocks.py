"""Blocks of rows as messages, and conversion to PX4's frames."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import copysign, pi
from struct import Struct
from typing import TypeAlias

import numpy as np

from colibri.common.types import Array, Vector
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu

BLOCK_ROWS = 32  # of PX4's topics: 1.28 s
EVERY_US = 40_000  # interval of PX4's topics, for viewers: PX4's own or shorter


class Thinning:
    """Picks the first sample of each `EVERY_US` of simulated time: the same in every log of a flight."""

    def __init__(self) -> None:
        self._before_us: float | None = None

    @property
    def next_us(self) -> float:
        """Return a time before which no sample is due."""
        return 0.0 if self._before_us is None else (self._before_us // EVERY_US + 1) * EVERY_US

    def is_due(self, time_us: float) -> bool:
        before_us, self._before_us = self._before_us, time_us
        return time_us % EVERY_US == 0 if before_us is None else time_us // EVERY_US != before_us // EVERY_US


Turn: TypeAlias = Callable[[Vector], Vector]  # change of axes: a permutation with signs


class Blocks(ABC):
    """Encoder of rows of some topics."""

    block_rows = BLOCK_ROWS  # rows of a block
    head = b""  # of a row

    def __init__(self, columns: int) -> None:
        self.pack = Struct(f"<{columns}d")  # a row as doubles

    @abstractmethod
    def encode(self, table: Array) -> bytes:
        """Return the messages of at most `block_rows` rows, (rows, columns)."""


class Turned:
    """Columns of a table in other frames; `places` has the slice of each result."""

    def __init__(self, columns: Sequence[str], **vectors: tuple[Turn, str]) -> None:
        """Convert vectors of three columns each: `POSITION=(ned_from_enu, "x y z")`; several may share a name."""
        picked: list[int] = []
        signs: list[float] = []
        self.places: dict[str, slice] = {}
        for name, (turn, names) in vectors.items():
            first, triples = len(picked), names.split()
            for place in range(0, len(triples), 3):
                x, y, z = (1.0 + columns.index(column) for column in triples[place : place + 3])
                for turned in turn((x, y, z)):  # numbers of columns, permuted and negated
                    picked.append(round(abs(turned)) - 1)
                    signs.append(copysign(1.0, turned))
            self.places[name] = slice(first, len(picked))
        self._picked, self._signs = np.array(picked), np.array(signs)

    def __call__(self, table: Array) -> Array:
        turned: Array = table[:, self._picked] * self._signs
        return turned


def attitude_ned(attitude: Array) -> Array:
    """Convert attitudes from FLU/ENU to FRD/NED, (n, 4)."""
    qw, qx, qy, qz = attitude.T
    return np.array(ned_frd_from_enu_flu((qw, qx, qy, qz))).T


def heading_from_yaw(yaw_rad: Array) -> Array:
    """Return the heading, -pi to pi clockwise from north, of an ENU yaw."""
    heading: Array = pi - np.remainder(pi / 2.0 + yaw_rad, 2.0 * pi)
    return heading
