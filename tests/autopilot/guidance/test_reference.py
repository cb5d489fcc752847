from math import hypot, pi, remainder, tau

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from colibri.autopilot.control.interface import Horizon
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.reference import (
    ALL_BOUND,
    BindingDerivative,
    Reference,
    Target,
    lead,
    lead_along,
    still_target,
    target_of,
)
from colibri.common.types import Array, Vector
from tests.support.strategies import ANGLES, reals

INTERVAL_S = 0.008
SAMPLES = 3
ORIGIN: Vector = (0.0, 0.0, 0.0)
LIMITS = st.builds(
    Limits,
    speed_m_s=st.floats(0.5, 15.0),
    climb_m_s=st.floats(0.5, 6.0),
    sink_m_s=st.floats(0.5, 4.0),
    acceleration_m_s2=st.floats(1.0, 8.0),
    lift_m_s2=st.floats(1.0, 6.0),
    jerk_m_s3=st.floats(5.0, 60.0),
    yaw_rate_rad_s=st.floats(0.2, 4.0),
    yaw_acceleration_rad_s2=st.floats(1.0, 8.0),
)
PLACES = st.tuples(reals(60.0), reals(60.0), reals(30.0))


def at(position: Vector, yaw_rad: float = 0.0, velocity: Vector = ORIGIN) -> Reference:
    motion = np.zeros((4, 3))
    motion[0], motion[1] = position, velocity
    return Reference(motion, np.array([yaw_rad, 0.0]))


def led(reference: Reference, target: Target, limits: Limits, seconds: float) -> tuple[Array, Array, Reference]:
    """Follow a target that does not change; return motion (n, 4, 3), heading (n, 2) and where that led."""
    motions, headings = [reference.motion], [reference.heading]
    for _ in range(round(seconds / INTERVAL_S)):
        _, reference = lead(reference, target, limits, INTERVAL_S)
        motions.append(reference.motion)
        headings.append(reference.heading)
    return np.array(motions), np.array(headings), reference


SLACK = 1.003  # of the acceleration, which follows a jerk that changes only once a sample
LATE_S = 2.0 * INTERVAL_S
"""How late an acceleration ends: it changes once a sample, so that a speed exceeds its limit by that much of it."""
START = at(ORIGIN)


def within(limits: Limits, motions: Array, headings: Array) -> bool:
    velocity, acceleration, jerk = motions[:, 1], motions[:, 2], motions[:, 3]
    shares = (
        np.hypot(velocity[:, 0], velocity[:, 1]).max() / (limits.speed_m_s + LATE_S * limits.acceleration_m_s2),
        velocity[:, 2].max() / (limits.climb_m_s + LATE_S * limits.lift_m_s2),
        -velocity[:, 2].min() / (limits.sink_m_s + LATE_S * limits.lift_m_s2),
        np.hypot(acceleration[:, 0], acceleration[:, 1]).max() / limits.acceleration_m_s2,
        np.abs(acceleration[:, 2]).max() / limits.lift_m_s2,
        np.hypot(jerk[:, 0], jerk[:, 1]).max() / limits.jerk_m_s3,
        np.abs(jerk[:, 2]).max() / limits.jerk_m_s3,
        np.abs(headings[:, 1]).max() / limits.yaw_rate_rad_s,
    )
    return bool(max(shares) <= SLACK)


@settings(max_examples=8)
@given(LIMITS, PLACES, ANGLES)
@example(Limits(2.0, 1.0, 1.0, 6.0, 1.0, 24.0, 1.0, 1.0), (0.0, 2.0, 0.0), 0.0)
@example(Limits(2.0, 2.0, 3.0, 7.0, 3.0, 26.0, 4.0, 5.0), (-5.0, -4.0, 3.0), 0.0)
@example(Limits(speed_m_s=14.0, acceleration_m_s2=8.0, jerk_m_s3=5.0), (40.0, 0.0, 0.0), pi)
def test_rest_to_rest_keeps_limits_and_does_not_overshoot(limits: Limits, place: Vector, yaw_rad: float) -> None:
    target = still_target(place, yaw_rad, SAMPLES)
    slowest_m_s = min(limits.speed_m_s, limits.climb_m_s, limits.sink_m_s)
    long_enough_s = 25.0 + hypot(*place) / slowest_m_s + pi / limits.yaw_rate_rad_s
    motions, headings, end = led(START, target, limits, long_enough_s)
    assert within(limits, motions, headings)
    assert (np.sign(place) * motions[:, 0] - np.abs(place)).max() <= 1e-9
    assert np.abs(headings[:, 0]).max() <= abs(yaw_rad) + 1e-9
    assert tuple(end.motion[0]) == place
    assert not end.motion[1:].any()
    assert remainder(end.heading[0] - yaw_rad, 2.0 * pi) == pytest.approx(0.0, abs=1e-12)
    assert end.heading[1] == 0.0


@settings(max_examples=8)
@given(LIMITS, st.tuples(reals(12.0), reals(12.0), reals(3.0)), reals(3.0))
def test_a_velocity_is_reached_and_a_vehicle_stops_from_any(limits: Limits, velocity: Vector, rate: float) -> None:
    target = still_target(ORIGIN, 0.0, SAMPLES, (BindingDerivative.VELOCITY,) * 3)._replace(turns=False)
    moving = at(ORIGIN, velocity=velocity)._replace(heading=np.array([0.0, rate]))
    motions, _, end = led(moving, target, limits, 25.0)
    assert np.abs(end.motion[1:]).max() < 1e-6
    assert abs(end.heading[1]) < 1e-6
    speeds = np.hypot(motions[:, 1, 0], motions[:, 1, 1])
    assert speeds.max() <= hypot(*velocity[:2]) + 1e-9


def circling(since_s: float, samples: int = SAMPLES) -> Target:
    angles = 0.5 * (since_s + INTERVAL_S * np.arange(samples))
    motion, heading = np.zeros((samples, 5, 3)), np.zeros((samples, 3))
    for order in range(5):
        spoke = 4.0 * (0.5j) ** order * np.exp(1j * angles)
        motion[:, order, 0], motion[:, order, 1] = spoke.real, spoke.imag
    heading[:, 0], heading[:, 1] = angles + 0.5 * pi, 0.5
    return Target(motion, ALL_BOUND, heading)


def test_a_moving_target_is_reached_and_followed_exactly() -> None:
    reference, sample = START, 0
    for sample in range(round(30.0 / INTERVAL_S)):
        horizon, reference = lead(reference, circling(sample * INTERVAL_S), Limits(), INTERVAL_S)
    target = circling(sample * INTERVAL_S)
    assert (np.stack(horizon[:5], axis=1) == target.motion).all()
    assert (horizon.yaw_rad - target.heading[:, 0]) % tau == pytest.approx(np.zeros(SAMPLES), abs=1e-9)
    assert (horizon.yaw_rate_rad_s == target.heading[:, 1]).all()


@given(st.integers(-3, 3), st.floats(0.0, 20.0))
def test_a_plan_that_is_reached_is_the_reference(turns: int, since_s: float) -> None:
    target = circling(since_s)
    start = Reference(target.motion[0, :4].copy(), target.heading[0, :2] + np.array([tau * turns, 0.0]))
    plan = Horizon(*(target.motion[:, order] for order in range(5)), *target.heading.T)
    for horizon, after in (lead(start, target, Limits(), INTERVAL_S), lead_along(start, plan, Limits(), INTERVAL_S)):
        assert (np.stack(horizon[:5], axis=1) == target.motion).all()
        assert horizon.yaw_rad == pytest.approx(target.heading[:, 0] + tau * turns, abs=1e-12)
        assert (after.motion == target.motion[1, :4]).all()
    assert (target_of(plan).motion == target.motion).all()


@settings(max_examples=15)
@given(LIMITS, PLACES, PLACES)
def test_a_target_that_jumps_is_followed_within_the_limits(limits: Limits, place: Vector, jumped: Vector) -> None:
    """The reference is on a target, to the last bit; the target jumps; the reference may not."""
    on_it = at(place)
    for follow in (still_target(jumped, 2.0, SAMPLES), still_target(jumped, -2.0, SAMPLES)):
        motions, headings, _ = led(on_it, follow, limits, 2.0)
        assert within(limits, motions, headings)
        steps = np.diff(motions[:, 0], axis=0)
        maximum = INTERVAL_S * hypot(limits.speed_m_s, max(limits.climb_m_s, limits.sink_m_s))
        assert np.linalg.norm(steps, axis=1).max() <= SLACK * maximum
        plan = Horizon(*(follow.motion[:, order] for order in range(5)), *follow.heading.T)
        assert (lead_along(on_it, plan, limits, INTERVAL_S)[1].motion == motions[1]).all()


@given(PLACES, ANGLES)
def test_the_preview_is_what_comes(place: Vector, yaw_rad: float) -> None:
    samples = 20
    target = still_target(place, yaw_rad, samples)
    horizon, reference = lead(START, target, Limits(), INTERVAL_S)
    previewed = np.stack(horizon[:4], axis=1)
    for sample in range(1, samples - 1):
        if (reference.motion[0] == target.motion[0, 0]).all():
            break  # reached: the last step onto it is not previewed
        assert previewed[sample] == pytest.approx(reference.motion, abs=1e-12)
        assert horizon.yaw_rad[sample] == pytest.approx(reference.heading[0], abs=1e-12)
        _, reference = lead(reference, target, Limits(), INTERVAL_S)
