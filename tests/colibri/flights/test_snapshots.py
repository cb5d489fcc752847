"""Snapshots of objects: what changes comes back, and in the same objects."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from random import Random

import msgspec
import numpy as np
import pytest

from colibri.flights.snapshots import ObjectSnapshot, SnapshotError


class Slotted:
    __slots__ = ("value",)

    def __init__(self, value: object) -> None:
        self.value = value


class Record(msgspec.Struct):
    value: int


@dataclass(frozen=True)
class Frozen:
    inside: list[int]


class Everything:
    def __init__(self) -> None:
        self.number = 1
        self.list, self.dict, self.set = [1, [2]], {"a": {"b": 1}}, {1}
        self.deque, self.bytes = deque([1, 2], maxlen=2), bytearray(b"ab")
        self.array = np.zeros(3)
        self.generator, self.random = np.random.default_rng(1), Random(1)
        self.slotted, self.record, self.frozen = Slotted(1), Record(1), Frozen([1])
        self.in_tuple = ([1],)
        total, counted = 0, [0]

        def count() -> int:
            nonlocal total
            total += 1
            counted[0] += 1
            return total + counted[0]

        self.count = count
        self.append = partial(self.list.append, 3)

    def seen(self) -> list[object]:
        return [
            *(self.number, [*self.list], str(self.dict), sorted(self.set), [*self.deque], bytes(self.bytes)),
            *(self.array.tolist(), self.slotted.value, self.record.value, self.frozen.inside[:], [*self.in_tuple[0]]),
            *(getattr(self, "later", None), self.generator.normal(), self.random.random(), self.count()),
        ]

    def change(self) -> None:
        self.number += 1
        self.append()
        self.dict["a"]["b"] = self.dict["c"] = {"d": 2}  # type: ignore[assignment]
        self.set.add(2)
        self.deque.append(3)
        self.bytes += b"c"
        self.array[1] = 5.0
        self.slotted.value, self.record.value, self.later = 2, 2, 7
        self.frozen.inside.append(2)
        self.in_tuple[0].append(2)


def test_all_that_changes_comes_back_as_often_as_needed() -> None:
    it, fresh = Everything(), Everything()
    expected = fresh.seen()
    snapshot = ObjectSnapshot([it])
    for _ in range(3):
        assert it.seen() == expected
        it.change()
        assert it.seen() != expected
        snapshot.restore()


def test_an_object_stays_the_same_object() -> None:
    it = Everything()
    inside, snapshot = it.list, ObjectSnapshot([it])
    it.list = []
    snapshot.restore()
    assert it.list is inside


def test_a_running_generator_is_refused() -> None:
    def numbers() -> Iterator[int]:
        yield 1

    with pytest.raises(SnapshotError, match=r"the state of a .*generator cannot be kept"):
        ObjectSnapshot([numbers()])
