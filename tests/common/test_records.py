from typing import NamedTuple

import numpy as np

from colibri.common.jit import compiled, inlined, opened, packed


class Inner(NamedTuple):
    weight: float
    rows: np.ndarray
    counts: np.ndarray


class Outer(NamedTuple):
    first: float
    inner: Inner
    few: np.ndarray
    many: np.ndarray


def outer() -> Outer:
    return Outer(0.5, Inner(2.0, np.arange(30.0).reshape(5, 6), np.arange(9)), np.array([1.0, 2.0]), np.arange(100.0))


def test_a_record_owns_the_numbers_packed_in_it() -> None:
    given = outer()
    record = packed(given)
    it = opened(record, Outer)
    given.many[:] = 0.0
    assert it.first == 0.5
    assert it.few.tolist() == [1.0, 2.0]
    assert it.many.tolist() == list(range(100))
    inner = Inner(*it.inner)
    assert inner.rows.tolist() == given.inner.rows.tolist()
    assert inner.counts.dtype == np.int64
    it.many[3], inner.rows[1, 2] = -1.0, -2.0
    assert record["many"][0, 3] == -1.0
    assert record["inner"]["rows"][0, 1, 2] == -2.0


@inlined
def _double(values: np.ndarray) -> None:
    for i in range(values.shape[0]):
        values[i] *= 2.0


@compiled
def _total(record: np.ndarray) -> float:
    it = record[0]
    _double(it.many)
    total: float = it.first + it.inner.weight * it.inner.rows[4, 5]
    for value in it.many:
        total += value
    return total


def test_kernels_read_and_write_nested_records() -> None:
    record = packed(outer())
    assert _total(record) == 0.5 + 2.0 * 29.0 + 2.0 * sum(range(100))
    assert opened(record, Outer).many[7] == 14.0
