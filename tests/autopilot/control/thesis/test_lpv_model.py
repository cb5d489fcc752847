"""The LPV model against the nonlinear one, and its discretisation against the literature."""

import numpy as np
import pytest
from hypothesis import given
from scipy.signal import cont2discrete

from colibri.autopilot.control.thesis.lpv_model import attitude_model, discretise
from colibri.common.types import Vector
from colibri.plant.physics.equations import angular_acceleration
from tests.support.strategies import reals, vectors

INERTIA = (0.0034, 0.0041, 0.006)


@given(vectors(3.0), vectors(0.1), reals(0.02))
def test_the_rate_rows_are_the_rigid_body_where_t_is_identity(rate: Vector, moment: Vector, momentum: float) -> None:
    """At phi = theta = 0 the Euler rates are the body rates, and the LPV model is exact but for how it splits p q."""
    A, B = attitude_model(rate[0], rate[1], momentum, inertia_kg_m2=INERTIA)
    x = np.array([0.0, rate[0], 0.0, rate[1], 0.0, rate[2]])
    nonlinear = angular_acceleration(rate, moment, momentum, 0.0, INERTIA)
    assert (A @ x + B @ np.array(moment))[1::2] == pytest.approx(nonlinear, abs=1e-9)


@given(reals(5.0), reals(5.0), reals(0.02))
def test_zero_order_hold(phi_rate: float, theta_rate: float, momentum: float) -> None:
    A, B = attitude_model(phi_rate, theta_rate, momentum, inertia_kg_m2=INERTIA)
    transition = discretise(A, B, 0.1, "zero-order-hold")
    Ad, Bd, *_ = cont2discrete((A, B, np.eye(6), np.zeros((6, 3))), 0.1)
    assert transition[:6, :6] == pytest.approx(Ad, abs=1e-9)
    assert transition[:6, 6:] == pytest.approx(Bd, rel=1e-9, abs=1e-9)
    assert transition[6:] == pytest.approx(np.hstack([np.zeros((3, 6)), np.eye(3)]))
