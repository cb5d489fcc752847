"""Rows of numbers that become messages a block at a time, and the vehicle's motion as topics."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import copysign, pi
from struct import Struct
from typing import TypeAlias

import numpy as np

from colibri.common.types import Array, Vector
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.topics import Records
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu

BLOCK_ROWS = 64
"""As the other logs have it: half a second at 125 Hz."""

Turn: TypeAlias = Callable[[Vector], Vector]
"""To other axes: components permuted, and some of them negated."""


class Blocks(ABC):
    """Rows that wait until they are a block, packed: fewer bytes and objects than numbers of Python's."""

    def __init__(self, columns: int) -> None:
        """Expect rows of so many numbers."""
        self._pack = Struct(f"<{columns}d").pack
        self._columns = columns
        self._waiting: list[bytes] = []

    def add(self, row: Sequence[float]) -> bytes:
        """Take a row; return the messages of a block once it is one, else nothing."""
        self._waiting.append(self._pack(*row))
        return self.take() if len(self._waiting) >= BLOCK_ROWS else b""

    def take(self) -> bytes:
        """Return the messages of the rows that wait, behind a mark for readers that have lost their place."""
        rows, self._waiting = self._waiting, []
        if not rows:
            return b""
        table = np.frombuffer(b"".join(rows)).reshape(len(rows), self._columns)
        with np.errstate(all="ignore"):  # a vehicle that is lost may have numbers that no float has
            return messages.SYNC + self.encode(table)

    @abstractmethod
    def encode(self, table: Array) -> bytes:
        """Return the messages of at most `BLOCK_ROWS` rows, (rows, columns)."""


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
