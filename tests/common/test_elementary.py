"""Elementary functions: as near to the truth as said, and the same from Python, in kernels and over arrays."""

import math
import random
from collections.abc import Callable
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common import elementary, elementwise, kernels

ONE_ULP, THREE_ULP = 1.0, 3.0
DIGITS = 60
COUNT = 400

ANGLES = st.one_of(st.floats(-10.0, 10.0), st.floats(-1e9, 1e9), st.floats(-1e-300, 1e-300))
PARTS = st.floats(-1.0, 1.0)
POSITIVE = st.one_of(st.floats(5e-324, 1e300), st.floats(0.5, 2.0))
DOMAINS = {
    "sin": ANGLES,
    "cos": ANGLES,
    "tan": ANGLES,
    "atan": st.floats(allow_nan=False),
    "asin": PARTS,
    "acos": PARTS,
    "exp": st.floats(-800.0, 800.0),
    "expm1": st.floats(-800.0, 800.0),
    "log": POSITIVE,
}


def series(x: Decimal, first: Decimal, ratio: Callable[[int], Decimal]) -> Decimal:
    """Return first (1 + r(1) + r(1) r(2) …): a power series by the ratios of its terms, times x² each."""
    total, term, k = Decimal(0), first, 0
    while abs(term) > Decimal(10) ** -(DIGITS + 5) * max(abs(total), Decimal(10) ** -400):
        total, k = total + term, k + 1
        term = term * ratio(k) * x
    return total


def true_sin(x: Decimal) -> Decimal:
    return series(x * x, x, lambda k: Decimal(-1) / (2 * k * (2 * k + 1)))


def true_cos(x: Decimal) -> Decimal:
    return series(x * x, Decimal(1), lambda k: Decimal(-1) / (2 * k * (2 * k - 1)))


def true_atan(x: Decimal) -> Decimal:
    halvings = 0
    while abs(x) > Decimal("0.2"):
        x, halvings = x / (1 + (1 + x * x).sqrt()), halvings + 1
    total, term, k = Decimal(0), x, 1
    while abs(term) > Decimal(10) ** -(DIGITS + 5) * abs(x):
        total, k = total + term / k, k + 2
        term = -term * x * x
    return total * Decimal(2**halvings)


TRUE: dict[str, tuple[Callable[[Decimal], Decimal], tuple[float, float], float]] = {
    "sin": (true_sin, (-8.0, 8.0), ONE_ULP),
    "cos": (true_cos, (-8.0, 8.0), ONE_ULP),
    "tan": (lambda x: true_sin(x) / true_cos(x), (-1.55, 1.55), THREE_ULP),
    "atan": (true_atan, (-4.0, 4.0), THREE_ULP),
    "asin": (lambda x: true_atan(x / (1 - x * x).sqrt()), (-0.999, 0.999), THREE_ULP),
    "acos": (lambda x: 2 * true_atan(((1 - x) / (1 + x)).sqrt()), (-0.999, 0.999), THREE_ULP),
    "exp": (Decimal.exp, (-30.0, 30.0), ONE_ULP),
    "expm1": (lambda x: x.exp() - 1, (-1.0, 1.0), THREE_ULP),
    "log": (Decimal.ln, (0.05, 20.0), ONE_ULP),
}


@pytest.mark.parametrize("name", TRUE)
def test_the_error_is_below_what_is_said(name: str) -> None:
    true, (low, high), ulps = TRUE[name]
    draw = random.Random(name)
    points = [draw.uniform(low, high) for _ in range(COUNT)]
    points += [x for x in (draw.choice((-1, 1)) * 10.0 ** draw.uniform(-9, 0) for _ in range(COUNT)) if low < x < high]
    with localcontext() as context:
        context.prec = DIGITS
        for x in points:
            exact = true(Decimal(x))
            unit = Decimal(math.ulp(float(exact)))
            assert abs(Decimal(vars(elementary)[name](x)) - exact) <= Decimal(ulps) * unit, x


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_an_angle_is_that_of_the_c_library_but_for_the_last_bits(y: float, x: float) -> None:
    expected = math.atan2(y, x)
    assert abs(elementary.atan2(y, x) - expected) <= THREE_ULP * math.ulp(expected)


@pytest.mark.parametrize("y", [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf])
@pytest.mark.parametrize("x", [0.0, -0.0, 1.0, -1.0, math.inf, -math.inf])
def test_signed_zeros_and_infinities_count_as_in_c(y: float, x: float) -> None:
    angle = elementary.atan2(y, x)
    assert (angle, math.copysign(1.0, angle)) == (math.atan2(y, x), math.copysign(1.0, math.atan2(y, x)))


def test_beyond_a_domain_nothing_raises() -> None:
    assert all(math.isnan(vars(elementary)[name](math.nan)) for name in DOMAINS)
    assert all(math.isnan(function(math.inf)) for function in (elementary.sin, elementary.cos, elementary.tan))
    assert all(math.isnan(function(1.5)) for function in (elementary.asin, elementary.acos))
    assert (elementary.exp(1e3), elementary.exp(-1e3), elementary.expm1(-1e3)) == (math.inf, 0.0, -1.0)
    assert (elementary.log(0.0), elementary.log(math.inf)) == (-math.inf, math.inf)
    assert math.isnan(elementary.log(-1.0))


@pytest.mark.parametrize("name", DOMAINS)
@given(st.data())
def test_kernels_and_arrays_give_the_same_bits(name: str, data: st.DataObject) -> None:
    x = data.draw(DOMAINS[name])
    expected = vars(elementary)[name](x)
    assert vars(kernels)[name](x) == expected
    if hasattr(elementwise, name):
        assert vars(elementwise)[name](np.array([x])).tolist() == [expected]


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_angles_of_points_have_the_same_bits(y: float, x: float) -> None:
    expected = elementary.atan2(y, x)
    assert kernels.atan2(y, x) == expected
    assert elementwise.atan2(np.array([y]), np.array([x])).tolist() == [expected]


@given(st.floats(1e-3, 10.0), st.floats(-6.0, 6.0))
def test_powers(x: float, y: float) -> None:
    assert elementary.power(x, y) == pytest.approx(x**y, rel=1e-14)
    assert kernels.power(x, y) == elementary.power(x, y)


def test_powers_of_zero_and_to_the_zeroth() -> None:
    assert (elementary.power(0.0, 5.0), elementary.power(0.0, 0.0), elementary.power(7.0, 0.0)) == (0.0, 1.0, 1.0)


def test_the_parts_of_the_constants_add_up() -> None:
    with localcontext() as context:
        context.prec = DIGITS
        half_pi = 2 * true_atan(Decimal(1))
        parts = [Fraction(elementary.HALF_PI), Fraction(elementary.HALF_PI_TAIL)]
        assert abs(sum(parts) - Fraction(half_pi)) < Fraction(1, 2**105)
        for step, (head, tail) in enumerate(elementary.ATAN):
            exact = Fraction(true_atan(Decimal(step) / elementary.ATAN_STEPS))
            assert abs(Fraction(head) + Fraction(tail) - exact) < Fraction(1, 2**100)
