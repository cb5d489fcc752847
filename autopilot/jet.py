"""Derivatives of a track without deriving: arithmetic on truncated Taylor series.

A jet holds x(t + h) = c0 + c1 h + c2 h² + … at many times t at once. Sums, products, sines and cosines of jets are
exact to the last coefficient kept, so a track that is written as a formula of its time has every derivative.
Source: Griewank and Walther, "Evaluating Derivatives" (2008), chapter 13.
"""

from math import factorial
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class Jet:
    """A quantity and its derivatives with respect to time.

    Attributes:
        coefficients: Taylor coefficients, lowest order first, (order + 1, n).
    """

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: Array) -> None:
        """Wrap Taylor coefficients, (order + 1, n)."""
        self.coefficients = coefficients

    @classmethod
    def time(cls, t: Array, order: int) -> Self:
        """Return time itself at `t` (n,), s, with derivatives up to `order`."""
        coefficients = np.zeros((order + 1, len(t)))
        coefficients[0] = t
        coefficients[1:2] = 1.0
        return cls(coefficients)

    def derivative(self, order: int) -> Array:
        """Return the derivative of that order, (n,); order 0 is the value."""
        derivative: Array = factorial(order) * self.coefficients[order]
        return derivative

    def __add__(self, other: "Jet | float") -> "Jet":
        """Add a jet or a constant."""
        if isinstance(other, Jet):
            return Jet(self.coefficients + other.coefficients)
        shifted = self.coefficients.copy()
        shifted[0] += other
        return Jet(shifted)

    def __mul__(self, other: "Jet | float") -> "Jet":
        """Multiply by a jet (Cauchy product) or a constant."""
        if not isinstance(other, Jet):
            return Jet(self.coefficients * other)
        a, b = self.coefficients, other.coefficients
        return Jet(np.array([(a[: k + 1] * b[k::-1]).sum(axis=0) for k in range(len(a))]))

    def __sub__(self, other: "Jet | float") -> "Jet":
        """Subtract a jet or a constant."""
        return self + -1.0 * other

    __radd__ = __add__
    __rmul__ = __mul__


def sin(x: Jet) -> Jet:
    """Return the sine of a jet in rad."""
    return _sin_cos(x)[0]


def cos(x: Jet) -> Jet:
    """Return the cosine of a jet in rad."""
    return _sin_cos(x)[1]


def _sin_cos(x: Jet) -> tuple[Jet, Jet]:
    """Both together, from s' = c x' and c' = -s x'."""
    a = x.coefficients
    s, c = np.empty_like(a), np.empty_like(a)
    s[0], c[0] = np.sin(a[0]), np.cos(a[0])
    for k in range(1, len(a)):
        slope = np.arange(1, k + 1)[:, None] * a[1 : k + 1]
        s[k] = (slope * c[k - 1 :: -1][:k]).sum(axis=0) / k
        c[k] = -(slope * s[k - 1 :: -1][:k]).sum(axis=0) / k
    return Jet(s), Jet(c)
