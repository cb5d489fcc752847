"""Arithmetic on Taylor series, against series known in closed form."""

from math import factorial

import numpy as np
import pytest
from hypothesis import given

from colibri.autopilot.guidance.trajectories.taylor import TaylorSeries, atan2
from colibri.common.types import Array
from tests.support.strategies import reals

ORDER = 5


def at(t: float) -> TaylorSeries:
    return TaylorSeries.time(np.array([t]), ORDER)


def derivatives(x: TaylorSeries) -> Array:
    return np.array([x.derivative(order)[0] for order in range(len(x.coefficients))])


@given(reals(3.0))
def test_the_direction_of_a_line_is_the_arc_tangent(t: float) -> None:
    """d/dt atan t = 1 / (1 + t²), whose derivatives are those of the imaginary part of 1 / (i + t)."""
    pole = [(-1.0) ** k * factorial(k) / complex(t, -1.0) ** (k + 1) for k in range(ORDER)]
    theta = derivatives(atan2(at(t), 0.0 * at(t) + 1.0))
    assert theta == pytest.approx([np.arctan(t), *(value.imag for value in pole)], rel=1e-9, abs=1e-9)


def test_nothing_has_no_direction() -> None:
    nothing = 0.0 * at(1.0)
    assert not derivatives(atan2(nothing, nothing)).any()
