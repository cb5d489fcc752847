"""Reduce long series to the points that a figure can show."""

import numpy as np

from colibri.common.types import Array

_AT_ONCE = 1024


class Extremes:
    """Rows over time; beyond `most`, a multiple of 4, the extremes of each column in equal spans.

    A span keeps two points, in order. While spans are narrower than a pixel, the curve covers the same pixels.
    """

    def __init__(self, columns: int, most: int) -> None:
        self._points: Array = np.empty((most, columns))
        self._count = 0
        self._span = 2
        self._rest: Array = np.empty((0, columns))

    def add(self, rows: Array) -> None:
        self._rest = np.concatenate([self._rest, rows])
        while len(self._rest) >= self._span:
            if self._count == len(self._points):
                self._halve()
                continue
            spans = min(len(self._rest) // self._span, (len(self._points) - self._count) // 2)
            taken, self._rest = np.split(self._rest, [spans * self._span])
            self._points[self._count : self._count + 2 * spans] = _extremes(taken, self._span)
            self._count += 2 * spans

    def points(self) -> list[Array]:
        """Return parts of (k, columns): all rows, or two points a span."""
        rest = _extremes(self._rest, len(self._rest)) if len(self._rest) > 1 else self._rest
        return [self._points[: self._count], rest]

    def _halve(self) -> None:
        for first in range(0, self._count, _AT_ONCE):
            points = self._points[first : first + _AT_ONCE]
            self._points[first // 2 : (first + len(points)) // 2] = _extremes(points, 4)
        self._count //= 2
        self._span *= 2


class EveryNth:
    """Rows; beyond `most`, every second, fourth or eighth row, and the last."""

    def __init__(self, columns: int, most: int) -> None:
        self._most = most
        self._kept: list[Array] = []
        self._count = self._seen = 0
        self._step = 1
        self._last: Array = np.empty((0, columns))

    def add(self, rows: Array) -> None:
        self._last = rows[-1:].copy()
        self._kept.append(rows[-self._seen % self._step :: self._step].copy())
        self._count += len(self._kept[-1])
        self._seen += len(rows)
        while self._count > self._most:
            self._kept = [np.concatenate(self._kept)[::2].copy()]
            self._count = len(self._kept[0])
            self._step *= 2

    def points(self) -> list[Array]:
        """Return parts of (k, columns)."""
        is_kept = (self._seen - 1) % self._step == 0
        return [*self._kept, self._last[: 0 if is_kept else 1]]


def _extremes(rows: Array, span: int) -> Array:
    """Return minimum and maximum of each `span` of n rows, by columns, in order, (2 n / span, columns)."""
    spans = rows.reshape(-1, span, rows.shape[1])
    places = np.sort(np.stack([spans.argmin(axis=1), spans.argmax(axis=1)], axis=1), axis=1)
    return np.take_along_axis(spans, places, axis=1).reshape(-1, rows.shape[1])
