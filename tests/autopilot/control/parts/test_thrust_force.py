"""The limits of the force that is asked of the thrust."""

from math import sqrt, tan

import numpy as np
import pytest
from hypothesis import given

from colibri.autopilot.control.parts.thrust_force import ForceLimits, limited_force
from tests.support.strategies import vectors

LIMITS = ForceLimits(True, tan(1.0), 1.0, 18.0, 1.0)


@given(vectors(100.0))
def test_limited_forces_keep_height_before_place(force: tuple[float, float, float]) -> None:
    limited = limited_force(force, LIMITS)
    assert limited[2] == min(max(force[2], 1.0), 18.0)
    horizontal = sqrt(limited[0] ** 2 + limited[1] ** 2)
    assert horizontal <= limited[2] * LIMITS.tilt_tangent * (1.0 + 1e-12)
    assert np.linalg.norm(limited) <= 18.0 * (1.0 + 1e-12)
    assert force[0] * limited[1] == pytest.approx(force[1] * limited[0], abs=1e-9)


def test_the_least_thrust_that_is_asked_for_has_a_direction() -> None:
    assert limited_force((0.5, 0.0, -3.0), LIMITS._replace(min_up_n=1.5)) == pytest.approx((0.5, 0.0, 1.5))
