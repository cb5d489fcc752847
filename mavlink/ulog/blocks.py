"""Rows of numbers that become messages a block at a time, and the vehicle's motion in PX4's frames."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import copysign, pi
from struct import Struct
from typing import TypeAlias

import numpy as np

from colibri.common.types import Array, Vector
from colibri.mavlink.ulog.topics import Records
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu

BLOCK_ROWS = 16
"""Of PX4's topics: 0.64 s."""
EVERY_US = 40_000
"""Interval of PX4's topics, which serve viewers: as PX4 logs them, or more often."""


class Thinning:
    """Picks the first of the samples of each `EVERY_US` of simulated time: the same in every log of a flight."""

    def __init__(self) -> None:
        self._before_us: int | None = None

    def is_due(self, time_us: int) -> bool:
        """Whether the sample of a time, which comes next, is picked."""
        before_us, self._before_us = self._before_us, time_us
        return time_us % EVERY_US == 0 if before_us is None else time_us // EVERY_US != before_us // EVERY_US


Turn: TypeAlias = Callable[[Vector], Vector]
"""To other axes: components permuted, and some of them negated."""


class Blocks(ABC):
    """Encodes rows of some topics, a block at a time.

    Attributes:
        block_rows: Rows of a block.
        pack: Packs a row as doubles: fewer bytes and objects than numbers of Python.
    """

    block_rows = BLOCK_ROWS

    def __init__(self, columns: int) -> None:
        self.pack = Struct(f"<{columns}d")

    @abstractmethod
    def encode(self, table: Array) -> bytes:
        """Return the messages of at most `block_rows` rows, (rows, columns)."""


class Turned:
    """Columns of a table in other frames: picked, and with their signs, all at once.

    Attributes:
        places: By which names they are picked, where they will be.
    """

    def __init__(self, columns: Sequence[str], **vectors: tuple[Turn, str]) -> None:
        """Turn vectors of three columns each of a table, `POSITION=(ned_from_enu, "x y z")`; several are one name."""
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
        """Return all of them, (rows, columns)."""
        turned: Array = table[:, self._picked] * self._signs
        return turned


def put_valid(records: Records, position: str) -> None:
    """Assign, once for all, that a position is known."""
    records[position, "xy_valid"][:] = True


def attitude_ned(attitude: Array) -> Array:
    """Return attitudes of FRD in NED, wxyz, (n, 4), of those of FLU in ENU, (n, 4)."""
    qw, qx, qy, qz = attitude.T
    return np.array(ned_frd_from_enu_flu((qw, qx, qy, qz))).T


def heading_from_yaw(yaw_rad: Array) -> Array:
    """Return the heading, -pi to pi clockwise from north, of a yaw counter-clockwise from east, (n,)."""
    heading: Array = pi - np.remainder(pi / 2.0 + yaw_rad, 2.0 * pi)
    return heading
