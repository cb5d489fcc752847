"""Derivatives by arithmetic on truncated Taylor series x(t + h) = c0 + c1 h + c2 h² + …, exact to the last coefficient.

Source: Griewank and Walther, "Evaluating Derivatives" (2008), chapter 13.
"""

from collections.abc import Callable
from math import factorial
from typing import Any, Self

import numpy as np

from colibri.common import elementwise
from colibri.common.types import Array


class TaylorSeries:
    """A quantity and its time derivatives.

    Attributes:
        coefficients: Taylor coefficients, lowest order first, (order + 1, n).
    """

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: Array) -> None:
        self.coefficients = coefficients

    @classmethod
    def time(cls, t: Array, order: int) -> Self:
        """Return time itself at `t` (n,), s, with derivatives up to `order`."""
        coefficients = np.zeros((order + 1, len(t)))
        coefficients[0] = t
        coefficients[1:2] = 1.0
        return cls(coefficients)

    def derivative(self, order: int) -> Array:
        """Return the derivative of an order, (n,); order 0 is the value."""
        derivative: Array = factorial(order) * self.coefficients[order]
        return derivative

    def rate(self) -> "TaylorSeries":
        """Return the series of the time derivative, one order shorter."""
        orders = np.arange(1.0, len(self.coefficients))
        return TaylorSeries(orders[:, None] * self.coefficients[1:])

    def padded_rate(self) -> "TaylorSeries":
        """Return the series of the time derivative, with 0 for its unknown highest coefficient."""
        return TaylorSeries(np.concatenate([self.rate().coefficients, np.zeros_like(self.coefficients[:1])]))

    def __add__(self, other: "TaylorSeries | Array | float") -> "TaylorSeries":
        if isinstance(other, TaylorSeries):
            return TaylorSeries(self.coefficients + other.coefficients)
        shifted = self.coefficients.copy()
        shifted[0] += other
        return TaylorSeries(shifted)

    def __mul__(self, other: "TaylorSeries | Array | float") -> "TaylorSeries":
        if not isinstance(other, TaylorSeries):
            return TaylorSeries(self.coefficients * other)
        a, b = self.coefficients, other.coefficients
        return TaylorSeries(np.array([(a[: k + 1] * b[k::-1]).sum(axis=0) for k in range(len(a))]))

    def __sub__(self, other: "TaylorSeries | Array | float") -> "TaylorSeries":
        return self + -1.0 * other

    def __rsub__(self, other: "Array | float") -> "TaylorSeries":
        return -1.0 * self + other

    def __neg__(self) -> "TaylorSeries":
        return -1.0 * self

    def __truediv__(self, divisor: float) -> "TaylorSeries":
        return self * (1.0 / divisor)

    def sin(self) -> "TaylorSeries":
        """Return the sine of a series in rad."""
        return sin(self)

    def cos(self) -> "TaylorSeries":
        """Return the cosine of a series in rad."""
        return cos(self)

    __radd__ = __add__
    __rmul__ = __mul__


def held(t: TaylorSeries, value: TaylorSeries | float) -> TaylorSeries:
    """Return a constant as a series at the times of `t`."""
    return value if isinstance(value, TaylorSeries) else 0.0 * t + value


def in_series(formula: Callable[[TaylorSeries], Any]) -> Callable[[TaylorSeries], Any]:
    """Wrap a formula of time so that constants become series."""

    def series(t: TaylorSeries) -> Any:
        value = formula(t)
        return tuple(held(t, one) for one in value) if np.iterable(value) else held(t, value)

    return series


def sin(x: TaylorSeries) -> TaylorSeries:
    return _sin_cos(x)[0]


def cos(x: TaylorSeries) -> TaylorSeries:
    return _sin_cos(x)[1]


def atan2(y: TaylorSeries, x: TaylorSeries) -> TaylorSeries:
    """Return the direction of (x, y), rad, 0 at x = y = 0, from (x² + y²) θ' = x y' - y x'."""
    squared = (x * x + y * y).coefficients
    turning = (x * y.padded_rate() - y * x.padded_rate()).coefficients
    theta = np.zeros_like(squared)
    theta[0] = elementwise.atan2(y.coefficients[0], x.coefficients[0])
    for k in range(1, len(theta)):
        slope = np.arange(1, k)[:, None] * theta[1:k]
        rest = turning[k - 1] - (slope * squared[k - 1 : 0 : -1]).sum(axis=0)
        np.divide(rest, k * squared[0], out=theta[k], where=squared[0] > 0.0)
    return TaylorSeries(theta)


def _sin_cos(x: TaylorSeries) -> tuple[TaylorSeries, TaylorSeries]:
    a = x.coefficients
    s, c = np.empty_like(a), np.empty_like(a)
    s[0], c[0] = elementwise.sin(a[0]), elementwise.cos(a[0])
    for k in range(1, len(a)):
        slope = np.arange(1, k + 1)[:, None] * a[1 : k + 1]
        s[k] = (slope * c[k - 1 :: -1][:k]).sum(axis=0) / k
        c[k] = -(slope * s[k - 1 :: -1][:k]).sum(axis=0) / k
    return TaylorSeries(s), TaylorSeries(c)
