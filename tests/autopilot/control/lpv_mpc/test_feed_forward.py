"""Flatness: what references ask for, flown by the model, is the reference."""

from math import pi, tan
from typing import TypeAlias

import numpy as np
import pytest

from colibri.autopilot.control.lpv_mpc import feed_forward, model
from colibri.autopilot.control.lpv_mpc.feed_forward import Approach, Flat
from colibri.autopilot.control.lpv_mpc.model import RIGID, Disturbance
from colibri.autopilot.control.lpv_mpc.mpc import model_of
from colibri.autopilot.control.parts.thrust_force import ForceLimits
from colibri.autopilot.control.vehicle_model.mixer import exact_inverse
from colibri.common.jit import packed
from colibri.common.rotations import quaternion_from_euler
from colibri.plant.vehicle.description import load_vehicle
from tests.support.lpv_mpc import ROTORS

INTERVAL_S = 0.008
STEPS = 40
MODEL = model_of(load_vehicle("hummingbird"), INTERVAL_S)
PACKED = packed(MODEL)
FROM_WRENCH = exact_inverse(MODEL.allocation)
WIDE = ForceLimits(True, tan(1.2), 0.2, 19.0, 0.2)
LEVEL = np.array([0.0] * 6 + [1.0] + [0.0] * 6)
CALM = Disturbance(np.zeros(3), np.zeros(3))
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
    from_wrench=FROM_WRENCH,
)


def flat() -> Flat:
    n = STEPS + 2
    return Flat(np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((STEPS, 3)), np.empty((STEPS + 1, ROTORS)))


def circle(radius_m: float, period_s: float) -> tuple[np.ndarray, ...]:
    """Position, velocity, acceleration and yaw on a level circle, looking outwards."""
    angle = 2.0 * pi / period_s * INTERVAL_S * np.arange(STEPS + 2)
    w, out = 2.0 * pi / period_s, np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    return radius_m * out, radius_m * w * along, -radius_m * w * w * out, angle


@pytest.mark.parametrize("disturbance", [CALM, Disturbance(np.array([0.5, -1.0, 0.7]), np.array([0.02, -0.01, 0.003]))])
def test_what_a_circle_asks_for_flies_the_circle(disturbance: Disturbance) -> None:
    p, v, a, yaw = circle(3.0, 3.0)
    asked = flat()
    feed_forward.ask(LEVEL, v, a, yaw, disturbance, WIDE, FROM_WRENCH, PACKED, asked)
    commands, limits = np.empty((STEPS, ROTORS)), np.tile([0.01, 1.0], (STEPS, 1))
    feed_forward.lead(asked.squared, MODEL.lag.left, limits, commands)
    R = asked.attitudes[0]
    psi, theta, phi = np.arctan2(R[1, 0], R[0, 0]), -np.arcsin(R[2, 0]), np.arctan2(R[2, 1], R[2, 2])
    rate = 2.0 * asked.rates[0] - asked.rates[1]
    rigid = np.concatenate([p[0], v[0], quaternion_from_euler(phi, theta, psi), rate])
    motion, speeds = np.empty((STEPS + 1, RIGID)), np.empty((STEPS + 1, ROTORS))
    drive = model.empty_drive(STEPS, ROTORS)
    model.roll_out(rigid, asked.squared[0], commands, disturbance, PACKED, drive, motion, speeds)
    assert np.abs(motion[:, :3] - p[:-1]).max() < 2e-3
    assert np.abs(motion[:, 3:6] - v[:-1]).max() < 0.03
    assert np.abs(motion[1:, 10:] - asked.rates).max() < 0.05


Three: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


def approached(position: np.ndarray, velocity: np.ndarray, feasible: float) -> tuple[Three, Three]:
    p, v, a, _ = circle(3.0, 3.0)
    references, near = (p, v, a), (np.empty_like(p), np.empty_like(p), np.empty_like(p))
    feed_forward.approach(position, velocity, references, feasible, 0.0, packed(GUIDANCE), near)
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
    assert feed_forward.feasible_part(v, a, CALM, WIDE, PACKED) == part


def test_the_approach_is_smooth_and_within_its_acceleration() -> None:
    """A vehicle that falls at 6 m/s, 1 m off a place that stands."""
    still = np.zeros((STEPS + 2, 3))
    p, v, a = near = (still.copy(), still.copy(), still.copy())
    position, velocity = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -6.0])
    feed_forward.approach(position, velocity, (still, still, still), 1.0, 0.0, packed(GUIDANCE), near)
    assert np.linalg.norm(a, axis=1).max() < 10.0
    assert a[0, 2] > 5.0
    assert np.diff(p, axis=0) / INTERVAL_S == pytest.approx(0.5 * (v[1:] + v[:-1]), abs=1e-3)
    assert np.diff(v, axis=0) / INTERVAL_S == pytest.approx(0.5 * (a[1:] + a[:-1]), abs=1e-3)


@pytest.mark.parametrize(("wind_m_s2", "speed_m_s", "exact"), [(5.0, 3.0, False), (5.0, 0.2, True), (1.0, 3.0, True)])
def test_in_strong_wind_a_near_vehicle_stops_gently(wind_m_s2: float, speed_m_s: float, exact: bool) -> None:
    still = np.zeros((STEPS + 2, 3))
    stop_s = feed_forward.stopping_s(Disturbance(np.array([wind_m_s2, 0.0, 0.0]), np.zeros(3)), PACKED)
    p, v, a = near = (still.copy(), still.copy(), still.copy())
    velocity = np.array([speed_m_s, 0.0, 0.0])
    feed_forward.approach(still[0], velocity, (still, still, still), 1.0, stop_s, packed(GUIDANCE), near)
    assert (not p.any() and not v.any() and not a.any()) is exact
    assert exact or speed_m_s > v[0, 0] > 0.9 * speed_m_s > v[-1, 0]
    assert np.linalg.norm(a, axis=1).max() < GUIDANCE.max_acceleration_m_s2


def test_what_comes_after_a_jump_is_not_followed_before_it() -> None:
    p, v, a, yaw = circle(3.0, 10.0)
    ends, stands, rests, looks = p.copy(), v.copy(), a.copy(), yaw.copy()
    ends[20:], stands[20:], rests[20:], looks[20:] = p[20], 0.0, 0.0, yaw[20]
    followed = feed_forward.before_jump((ends, stands, rests, looks), INTERVAL_S)
    for wanted, got in zip((p, v, a, yaw), followed, strict=True):
        assert (got[:20] == wanted[:20]).all()
        assert np.abs(got - wanted).max() < 0.02 * np.abs(wanted).max()
    assert stands[20, 1] == 0.0, "what was given stays"
