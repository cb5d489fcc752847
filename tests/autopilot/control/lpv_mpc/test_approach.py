"""References that lead to far ones: their speed, acceleration, and what they leave out."""

from typing import TypeAlias

import numpy as np
import pytest

from colibri.autopilot.control.lpv_mpc.approach import Approach, approach, before_jump, feasible_part, stopping_s
from colibri.autopilot.control.lpv_mpc.model import Disturbance
from colibri.common.jit import packed
from tests.support.lpv_mpc import CALM, INTERVAL_S, LAP_STEPS, PACKED, ROTORS, WIDE, circle

GUIDANCE = Approach(
    k1_s2=30.0,
    k2_s=11.0,
    max_error_m=1.1,
    follow_within_m=1.1,
    max_acceleration_m_s2=10.0,
    max_climb_m_s2=10.0,
    exact_within_m=0.3,
    interval_s=INTERVAL_S,
    recovery_1_s2=30.0,
    recovery_1_s=11.0,
    from_wrench=np.zeros((ROTORS, 4)),
)

Three: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


def approached(position: np.ndarray, velocity: np.ndarray, feasible: float) -> tuple[Three, Three]:
    p, v, a, _ = circle(3.0, 3.0)
    references, near = (p, v, a), (np.empty_like(p), np.empty_like(p), np.empty_like(p))
    approach(position, velocity, references, feasible, 0.0, packed(GUIDANCE), near)
    return references, near


def test_an_impossible_motion_leads_back_from_far_away() -> None:
    """At the approach speed of 3 m/s, 50 m away: neither the place nor the speed of the reference is asked for."""
    _, near = approached(np.array([53.0, 0.0, 0.0]), np.array([-3.0, 0.0, 0.0]), 0.0)
    assert np.abs(np.diff(near[0], axis=0) / INTERVAL_S - near[1][:-1]).max() < 0.2
    assert near[0][0] == pytest.approx([53.0, 0.0, 0.0], abs=0.03)
    assert near[1][0] == pytest.approx([-3.0, 0.0, 0.0], abs=0.1)
    assert np.abs(near[2][0]).max() < 1.6


def test_a_possible_motion_counts_in_full_from_far_away() -> None:
    """50 m away, beside the reference at its speed: the error closes at 3 m/s."""
    (_, v, a), near = approached(np.array([53.0, 0.0, 0.0]), circle(3.0, 3.0)[1][0] - np.array([3.0, 0.0, 0.0]), 1.0)
    assert near[1] == pytest.approx(v - np.array([3.0, 0.0, 0.0]), abs=0.05)
    assert near[2] == pytest.approx(a, abs=0.1)


@pytest.mark.parametrize(("period_s", "part"), [(4.0, 1.0), (1.2, 0.0)])
def test_what_needs_more_than_the_largest_thrust_is_impossible(period_s: float, part: float) -> None:
    _, v, a, _ = circle(3.0, period_s)
    assert feasible_part(v, a, CALM, WIDE, PACKED) == part


def test_the_approach_is_smooth_and_within_its_acceleration() -> None:
    """A vehicle that falls at 6 m/s, 1 m off a place that stands."""
    still = np.zeros((LAP_STEPS + 2, 3))
    p, v, a = near = (still.copy(), still.copy(), still.copy())
    position, velocity = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -6.0])
    approach(position, velocity, (still, still, still), 1.0, 0.0, packed(GUIDANCE), near)
    assert np.linalg.norm(a, axis=1).max() < 10.0
    assert a[0, 2] > 5.0
    assert np.diff(p, axis=0) / INTERVAL_S == pytest.approx(0.5 * (v[1:] + v[:-1]), abs=1e-3)
    assert np.diff(v, axis=0) / INTERVAL_S == pytest.approx(0.5 * (a[1:] + a[:-1]), abs=1e-3)


@pytest.mark.parametrize(("wind_m_s2", "speed_m_s", "exact"), [(5.0, 3.0, False), (5.0, 0.2, True), (1.0, 3.0, True)])
def test_in_strong_wind_a_near_vehicle_stops_gently(wind_m_s2: float, speed_m_s: float, exact: bool) -> None:
    still = np.zeros((LAP_STEPS + 2, 3))
    stop_s = stopping_s(Disturbance(np.array([wind_m_s2, 0.0, 0.0]), np.zeros(3)), PACKED)
    p, v, a = near = (still.copy(), still.copy(), still.copy())
    velocity = np.array([speed_m_s, 0.0, 0.0])
    approach(still[0], velocity, (still, still, still), 1.0, stop_s, packed(GUIDANCE), near)
    assert (not p.any() and not v.any() and not a.any()) is exact
    assert exact or speed_m_s > v[0, 0] > 0.9 * speed_m_s > v[-1, 0]
    assert np.linalg.norm(a, axis=1).max() < GUIDANCE.max_acceleration_m_s2


def test_what_comes_after_a_jump_is_not_followed_before_it() -> None:
    p, v, a, yaw = circle(3.0, 10.0)
    ends, stands, rests, looks = p.copy(), v.copy(), a.copy(), yaw.copy()
    ends[20:], stands[20:], rests[20:], looks[20:] = p[20], 0.0, 0.0, yaw[20]
    followed = before_jump((ends, stands, rests, looks), INTERVAL_S)
    for wanted, got in zip((p, v, a, yaw), followed, strict=True):
        assert (got[:20] == wanted[:20]).all()
        assert np.abs(got - wanted).max() < 0.02 * np.abs(wanted).max()
    assert stands[20, 1] == 0.0, "what was given stays"
