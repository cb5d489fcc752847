"""The disturbance observers against a vehicle that feels what they should find."""

import numpy as np
import pytest

from colibri.autopilot.control.vehicle_model.airframe import Airframe
from colibri.autopilot.control.vehicle_model.disturbance_observer import (
    ESTIMATES,
    MEASURED,
    ObserverModel,
    gains,
    limit_near_ground,
    observe,
)
from colibri.common.jit import packed

INTERVAL_S = 0.008
AIRFRAME = Airframe(0.7, 9.81, 0.0, 0.0, 0.0)
INERTIA = np.array([0.003, 0.004, 0.006])
OBSERVER = ObserverModel(*gains(9.0, INTERVAL_S), *gains(12.0, INTERVAL_S), 6.0, 0.3, AIRFRAME, INERTIA, INTERVAL_S)
HOVER = np.array([0.7 * 9.81, 0.0, 0.0, 0.0])
NO_MOMENT = np.zeros(3)


def fly(acceleration: np.ndarray, moment: np.ndarray, seconds: float, observer: ObserverModel = OBSERVER) -> np.ndarray:
    """Let level thrust and a constant disturbance act, but for gyroscopic coupling, which the caller avoids."""
    measured = np.zeros(MEASURED)
    measured[8] = 1.0
    estimate = np.concatenate([measured[:6], np.zeros(6)])
    for _ in range(round(seconds / INTERVAL_S)):
        now = measured.copy()
        now[:3] += INTERVAL_S * acceleration
        now[3:6] += INTERVAL_S * moment / INERTIA
        estimate = observe(estimate, measured, now, HOVER, 0.0, 0.7, packed(observer)[0])
        measured = now
    return estimate


@pytest.mark.parametrize("axis", range(3))
def test_constant_disturbances_are_found(axis: int) -> None:
    unit = np.eye(3)[axis]
    estimate = fly(1.5 * unit, 1e-3 * unit, 2.0)
    assert estimate[6:9] == pytest.approx(1.5 * unit, abs=1e-4)
    assert estimate[9:] == pytest.approx(1e-3 * unit, abs=1e-6)


def test_both_poles_are_where_they_were_placed() -> None:
    """A step is seen as 1 - (1 + n (1 - p) / p ...) p^n: after one time constant 26 % of it, after five 96 %."""
    seen = [fly(np.array([1.0, 0, 0]), NO_MOMENT, factor / 9.0)[6] for factor in (1.0, 5.0)]
    assert seen == pytest.approx([1.0 - 2.0 * np.exp(-1.0), 1.0 - 6.0 * np.exp(-5.0)], abs=0.03)


def test_no_more_is_estimated_than_the_limit() -> None:
    cautious = OBSERVER._replace(max_acceleration_m_s2=1.0, max_moment_n_m=1e-3)
    estimate = fly(np.array([5.0, 0.0, -5.0]), np.array([0.01, 0.0, 0.0]), 2.0, cautious)
    assert estimate[6:9] == pytest.approx([1.0, 0.0, -1.0])
    assert estimate[9] == pytest.approx(1e-3)


def test_an_estimate_that_decays_becomes_zero() -> None:
    """Otherwise it would end among the subnormal numbers, with which the law takes seven times as long."""
    level, estimate = np.array([*NO_MOMENT, *NO_MOMENT, 0.0, 0.0, 1.0]), np.full(ESTIMATES, 1e-9)
    for _ in range(round(30.0 / INTERVAL_S)):
        estimate = observe(estimate, level, level, HOVER, 0.0, 0.7, packed(OBSERVER)[0])
    assert not estimate.any()


def test_near_the_ground_only_small_disturbances_are_learned() -> None:
    found, before = np.array([*range(6), 3.0, -3.0, 3.0, 0.25, -0.25, 0.25]), np.zeros(ESTIMATES)
    before[11] = 0.2
    estimate = found.copy()
    limit_near_ground(estimate, before, packed(OBSERVER)[0])
    assert estimate[8:] == pytest.approx([1.2, 0.06, -0.06, 0.2])
    assert (estimate[:8] == found[:8]).all()
    estimate[8] = -3.0
    limit_near_ground(estimate, before, packed(OBSERVER)[0])
    assert estimate[8] == -3.0, "a payload"


def test_the_models_coupling_and_drag_are_no_disturbance() -> None:
    h = 1e-6
    before = np.array([3.0, -1.0, 0.5, 2.0, -1.0, 0.7, 0.0, 0.0, 1.0])
    airframe = AIRFRAME._replace(drag_xy=0.2, drag_z=0.05)
    drag = np.array([-0.6, 0.2, -0.025])
    p, q, r = before[3:6]
    ix, iy, iz = INERTIA
    momentum = 2e-3
    turn = [((iy - iz) * q * r - momentum * q) / ix, ((iz - ix) * p * r + momentum * p) / iy, (ix - iy) * p * q / iz]
    now = before.copy()
    now[:3] += h * drag / 0.7
    now[3:6] += h * np.array(turn)
    model = packed(ObserverModel(*gains(9.0, h), *gains(12.0, h), 6.0, 0.3, airframe, INERTIA, h))[0]
    estimate = observe(np.concatenate([before[:6], np.zeros(6)]), before, now, HOVER, momentum, 0.7, model)
    assert estimate[:6] == pytest.approx(now[:6], abs=1e-11)
    assert estimate[6:] == pytest.approx(np.zeros(6), abs=1e-9)
