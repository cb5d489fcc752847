"""A magnetic field that comes late: it varies as the attitude predicted some time before, until it varies as now.

Turns to and fro then make innovations that a filter takes for a bias of the gyroscope. Slow changes are left out: with
a bias, too, the prediction of a steady turn leads.
"""

from collections import deque

from colibri.common.types import Vector

_EVERY_US = 25_000
_LAGS = (2, 4, 6, 8, 12, 16, 20, 24)  # in samples: 0.05 to 0.6 s
_SLOW, _WINDOW = 0.1, 40  # filter gain of means, over 0.25 s; variances about them are of so many samples: 1 s
_LARGE = 36.0  # least variance of the error, in those of an axis
_TURNS, _FITS = 0.25, 0.35  # in parts of it: least variance of the field, and largest of the error at the right lag
_WORSE = 1.25  # than at the right lag the field must fit at the longest: a wrong attitude may improve with the lag
_FITTING = 4  # samples in a row: 0.1 s, in which a sudden bias moves the best lag to the longest
_SUSPECT, _SUSPECTED_US = 0.5, 600_000  # as _FITS, within such a time, if GPS velocity contradicts the attitude, too
_TURNS_AGAIN, _FITS_AGAIN = 2.0, 0.5  # of a field on time again: least variance, in parts of _LARGE, largest error
_NOTHING: Vector = (0.0, 0.0, 0.0)


class FieldLag:
    """Compares a field with its predictions of now and before; `variance` of an axis in gauss².

    Attributes:
        late: Whether the field comes late.
    """

    def __init__(self, variance: float) -> None:
        self._large = _LARGE * variance
        self._next_us = 0
        self.late, self._fitting, self._suspected_us = False, 0, -_SUSPECTED_US
        self._predicted: deque[Vector] = deque(maxlen=_LAGS[-1])
        self._measured, self._now, self._before = _Spread(), _Spread(), [_Spread() for _ in _LAGS]

    def add(self, measured: Vector, predicted: Vector, time_us: int) -> None:
        """Add a field and its prediction, gauss FLU."""
        if time_us < self._next_us:
            return
        self._next_us = time_us + _EVERY_US
        known = self._predicted
        if len(known) == _LAGS[-1]:
            self._measured.add(measured, _NOTHING)
            self._now.add(measured, predicted)
            for spread, lag in zip(self._before, _LAGS, strict=True):
                spread.add(measured, known[-lag])
        known.append(predicted)
        error, turns, at_lags = self._now.variance, self._measured.variance, [each.variance for each in self._before]
        least = min(at_lags)
        if self.late:
            self.late = error > self._large or turns < _TURNS_AGAIN * self._large or error > _FITS_AGAIN * least
            return
        differs = error > self._large and turns > _TURNS * error and at_lags[-1] > _WORSE * least
        if differs and least < _SUSPECT * error:
            self._suspected_us = time_us
        self._fitting = self._fitting + 1 if differs and least < _FITS * error else 0
        self.late = self._fitting >= _FITTING

    def convict(self, now_us: int) -> bool:
        """Decide whether the field or the gyroscope is wrong; return whether the field comes late."""
        self.late |= now_us - self._suspected_us < _SUSPECTED_US
        return self.late


class _Spread:
    """Slow mean of the differences of two vectors, and the variance of the last ones about it.

    Turns are forgotten at once after the window: before a fault they make each lag look bad.
    """

    def __init__(self) -> None:
        self._mean: Vector | None = None
        self._parts = deque([0.0] * _WINDOW, maxlen=_WINDOW)
        self.variance = 0.0

    def add(self, one: Vector, other: Vector) -> None:
        (x, y, z), (a, b, c) = one, other
        x, y, z = x - a, y - b, z - c
        mx, my, mz = self._mean or (x, y, z)
        dx, dy, dz = x - mx, y - my, z - mz
        self._mean = (mx + _SLOW * dx, my + _SLOW * dy, mz + _SLOW * dz)
        part = (dx * dx + dy * dy + dz * dz) / _WINDOW
        self.variance += part - self._parts[0]
        self._parts.append(part)
