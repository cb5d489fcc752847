"""The LPV model as an object: it is the nonlinear model at its point, and sampled it is its exact solution."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete

import colibri
from colibri import lpv
from colibri.autopilot.control.thesis.condensed_mpc import Weights, augment, condense
from colibri.autopilot.control.thesis.lpv_model import Discretisation

VEHICLES = ("hummingbird-thesis", "hummingbird")
POINTS = (lpv.HOVER, lpv.Point(0.4, -0.3, (4000.0, 4500.0, 4100.0, 4700.0)))


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("point", POINTS)
def test_it_is_the_nonlinear_model_at_its_point(name: str, point: lpv.Point) -> None:
    vehicle = colibri.load_vehicle(name)
    A, B, C, D, _ = lpv.model(vehicle, point)
    (ix, iy, iz), h = vehicle.body.inertia_kg_m2, float(vehicle.rotor_momentum() @ np.array(point.rotor_speeds))
    p, q, r, u2, u3, u4 = point.phi_rate_rad_s, point.theta_rate_rad_s, 0.7, 0.01, -0.02, 0.003
    turned = (
        q * r * (iy - iz) / ix - h * q / ix + u2 / ix,
        p * r * (iz - ix) / iy + h * p / iy + u3 / iy,
        p * q * (ix - iy) / iz + u4 / iz,
    )
    x = np.array([0.1, p, 0.2, q, 0.3, r])
    rates = A @ x + B @ np.array([u2, u3, u4])
    assert rates[::2] == pytest.approx([p, q, r])
    assert rates[1::2] == pytest.approx(turned)
    assert C @ x + D @ np.ones(3) == pytest.approx([0.1, 0.2, 0.3])


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize(("method", "theirs"), [("zero-order-hold", "zoh"), ("forward-euler", "euler")])
def test_sampled_it_is_what_scipy_samples(point: lpv.Point, method: Discretisation, theirs: Any) -> None:
    continuous = lpv.model("hummingbird-thesis", point)
    sampled = continuous.sampled(0.1, method)
    A, B, *_ = cont2discrete((continuous.A, continuous.B, continuous.C, continuous.D), 0.1, theirs)
    np.testing.assert_allclose(sampled.A, A, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(sampled.B, B, rtol=1e-9, atol=1e-12)
    for interval_s in (0.0, -0.1, float("nan")):
        with pytest.raises(ValueError, match="must be above 0 s"):
            continuous.sampled(interval_s)


def test_the_condensed_qp_is_the_thesis_formula() -> None:
    model, horizon = lpv.model("hummingbird-thesis", POINTS[1]).sampled(0.1), 4
    n, m, p = 6, 3, 3
    transition = np.block([[model.A, model.B], [np.zeros((m, n)), np.eye(m)]])
    increments = augment(transition, model.C)
    A, B, C = increments
    powers = [np.linalg.matrix_power(A, k) for k in range(horizon + 1)]
    stacked = np.vstack(powers[1:])
    controls = np.block(
        [[powers[i - j] @ B if j <= i else np.zeros_like(B) for j in range(horizon)] for i in range(horizon)]
    )
    outputs = np.kron(np.eye(horizon), C)
    x, r = np.linspace(-0.1, 0.1, n + m), np.linspace(0.0, 0.2, horizon * p)
    H = controls.T @ outputs.T @ outputs @ controls + np.eye(horizon * m)
    f = controls.T @ outputs.T @ (outputs @ stacked @ x - r)
    qp = condense(increments, horizon, x, r.reshape(horizon, p), Weights(np.ones(p), np.ones(p), np.ones(m)))
    np.testing.assert_allclose(qp.H, H, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(qp.f, f, rtol=1e-9, atol=1e-12)
