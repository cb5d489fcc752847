"""Elementary functions with the same bits on every computer, unlike the C library's.

Each is an argument reduction and a Taylor series in IEEE 754 operations in the order written; `math.sqrt` and
`math.hypot` are exact anyway. Errors stay below one unit in the last place for sin, cos, exp and log, below three for
the others. Outside its domain a function returns nan or infinity.

Reductions with head and tail (the head's rounding error): W. J. Cody and W. Waite, Software Manual for the Elementary
Functions, 1980; K. C. Ng, Argument Reduction for Huge Arguments, 1992.
"""

from math import copysign, factorial, floor, frexp, inf, isnan, ldexp, nan, pi, sqrt
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Real = TypeVar("Real", float, NDArray[np.float64])

QUARTERS_PER_RAD = 2.0 / pi
_QUARTER_1, _QUARTER_2 = float.fromhex("0x1.921fb54400000p+0"), float.fromhex("0x1.0b4611a600000p-34")
_QUARTER_3 = 2.022266248795951e-21
"""π/2 = _QUARTER_1 + _QUARTER_2 + _QUARTER_3; the first two have 33 bits, so their multiples are exact."""
MAX_RAD = 1e6  # larger angles are first reduced modulo the double nearest 2π: as exact as the argument itself
HALF_PI = 0.5 * pi
HALF_PI_TAIL = 6.123233995736766e-17

_LN2 = 0.6931471805599453
_LN2_1, _LN2_2 = float.fromhex("0x1.62e42fee00000p-1"), 1.9082149292705877e-10  # the first has 32 bits
_MAX_EXPONENT, _MIN_EXPONENT = 709.782712893384, -745.2
_SMALL_EXP = 0.35
_HALF_SQRT2 = sqrt(0.5)

_SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(1, 9))  # of x^3, x^5 … x^17
_COSINE = tuple((-1.0) ** k / factorial(2 * k) for k in range(2, 10))  # of x^4, x^6 … x^18
_EXPONENTIAL = tuple(1.0 / factorial(k) for k in range(2, 14))  # of x^2, x^3 … x^13
_LOGARITHM = tuple(2.0 / (2 * k + 1) for k in range(1, 11))  # of s^2 … s^20 in log((1 + s) / (1 - s)) / s - 2
_ARCTANGENT = tuple((-1.0) ** k / (2 * k + 1) for k in range(1, 6))  # of x^3, x^5 … x^11

ATAN_STEPS = 16  # atan is tabulated at each sixteenth from 0 to 1
ATAN = (
    (0.0, 0.0),
    (0.06241880999595735, -1.5490756308295046e-18),
    (0.12435499454676144, -3.1253241424539383e-18),
    (0.18534794999569476, 4.180692268843079e-18),
    (0.24497866312686414, 1.0698755618734451e-17),
    (0.3028848683749714, -1.1010827903001369e-17),
    (0.35877067027057225, -2.4623815582638635e-17),
    (0.4124104415973873, -1.587652227770689e-17),
    (0.4636476090008061, 2.2698777452961687e-17),
    (0.5123894603107377, -2.5462781472855804e-17),
    (0.5585993153435624, -5.4556305485916264e-18),
    (0.6022873461349642, 2.950430737228402e-17),
    (0.6435011087932844, 1.5834785051444286e-17),
    (0.6823165548747481, 6.943223671560008e-18),
    (0.7188299996216245, -2.1478388444456983e-17),
    (0.7531512809621944, -2.4256934659182068e-17),
    (0.7853981633974483, 3.061616997868383e-17),
)
"""Heads and tails, (17, 2)."""


def series(coefficients: tuple[float, ...], x: Real) -> Real:
    """Return c₀ + c₁ x + c₂ x² …, from the highest power."""
    total = coefficients[-2] + x * coefficients[-1]
    for k in range(len(coefficients) - 3, -1, -1):
        total = coefficients[k] + x * total
    return total


def reduced(x: Real, n: Real) -> tuple[Real, Real]:
    """Return head and tail of x - n π/2."""
    first = x - n * _QUARTER_1
    rest = first - n * _QUARTER_2
    taken = n * _QUARTER_3 - ((first - rest) - n * _QUARTER_2)
    head = rest - taken
    return head, (rest - head) - taken


def sine(x: Real, tail: Real) -> Real:
    """Return sin(x + tail), |x| <= π/4."""
    z = x * x
    return x + (x * z * series(_SINE, z) + tail * (1.0 - 0.5 * z))


def cosine(x: Real, tail: Real) -> Real:
    """Return cos(x + tail), |x| <= π/4."""
    z = x * x
    half = 0.5 * z
    head = 1.0 - half
    return head + (((1.0 - head) - half) + (z * z * series(_COSINE, z) - x * tail))


def arctangent(x: Real, c: Real, head: Real, tail: Real) -> Real:
    """Return atan(x), 0 <= x <= 1, from a nearby atan(c) = head + tail."""
    t = (x - c) / (1.0 + x * c)
    z = t * t
    return head + (t + (tail + t * z * series(_ARCTANGENT, z)))


def turned_sine(x: float, quarters: int) -> float:
    """Return the sine of `x` rad plus `quarters` right angles."""
    if not abs(x) < inf:
        return nan
    if abs(x) > MAX_RAD:
        x = x % (2.0 * pi)
    n = floor(x * QUARTERS_PER_RAD + 0.5)
    head, tail = reduced(x, n)
    value = cosine(head, tail) if (n + quarters) & 1 else sine(head, tail)
    return -value if (n + quarters) & 2 else value


def sin(x: float) -> float:
    return turned_sine(x, 0)


def cos(x: float) -> float:
    return turned_sine(x, 1)


def tan(x: float) -> float:
    return sin(x) / cos(x)


def atan2(y: float, x: float) -> float:
    """Return an angle in [-π, π]; signed zeros and infinities as in C."""
    if isnan(x) or isnan(y):
        return nan
    across, along = abs(y), abs(x)
    if across == inf and along == inf:
        across, along = 1.0, 1.0
    steep = across > along
    larger, smaller = (across, along) if steep else (along, across)
    slope = smaller / larger if larger > 0.0 else 0.0
    step = int(slope * ATAN_STEPS + 0.5)
    angle = arctangent(slope, step / ATAN_STEPS, ATAN[step][0], ATAN[step][1])
    if steep:
        angle = HALF_PI - (angle - HALF_PI_TAIL) if x > 0.0 else HALF_PI + (angle + HALF_PI_TAIL)
    elif copysign(1.0, x) < 0.0:
        angle = pi - (angle - 2.0 * HALF_PI_TAIL)
    return copysign(angle, y)


def atan(x: float) -> float:
    return atan2(x, 1.0)


def asin(x: float) -> float:
    return atan2(x, sqrt((1.0 - x) * (1.0 + x))) if abs(x) <= 1.0 else nan


def acos(x: float) -> float:
    return atan2(sqrt((1.0 - x) * (1.0 + x)), x) if abs(x) <= 1.0 else nan


def _growth(x: float, tail: float) -> float:
    """Return exp(x + tail) - 1, |x| <= 0.35, `tail` the rounding error of x."""
    return x + (x * x * series(_EXPONENTIAL, x) + tail * (1.0 + x))


def exp(x: float) -> float:
    if isnan(x):
        return x
    if x > _MAX_EXPONENT:
        return inf
    if x < _MIN_EXPONENT:
        return 0.0
    n = floor(x / _LN2 + 0.5)
    first, taken = x - n * _LN2_1, n * _LN2_2
    head = first - taken
    return ldexp(1.0 + _growth(head, (first - head) - taken), int(n))


def expm1(x: float) -> float:
    return _growth(x, 0.0) if abs(x) < _SMALL_EXP else exp(x) - 1.0


def log(x: float) -> float:
    if isnan(x) or x < 0.0:
        return nan
    if x == 0.0:
        return -inf
    if x == inf:
        return inf
    part, n = frexp(x)
    if part < _HALF_SQRT2:
        part, n = 2.0 * part, n - 1
    f = part - 1.0
    s, half = f / (2.0 + f), 0.5 * f * f
    z = s * s
    return n * _LN2_1 - ((half - (s * (half + z * series(_LOGARITHM, z)) + n * _LN2_2)) - f)


def power(x: float, y: float) -> float:
    """Return `x` >= 0 to the power of `y`; the relative error grows with |y log x|."""
    return 1.0 if y == 0.0 else exp(y * log(x))


def square(x: float) -> float:
    """Return `x` squared; `x**2` calls the C library's `pow`."""
    return x * x
