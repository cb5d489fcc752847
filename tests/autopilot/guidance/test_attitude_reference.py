from math import acos, cos, degrees, nan, pi, radians, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.autopilot.control.interface import AttitudeDemand, Preview, VehicleState
from colibri.autopilot.guidance.attitude_reference import (
    AttitudeLimits,
    AttitudeReference,
    ReferenceMemory,
    attitude_command,
    attitude_limits,
    rate_command,
    tilt_command,
)
from colibri.autopilot.guidance.attitude_slew import AttitudeCommand
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler, rotation_matrix
from colibri.common.types import Quaternion
from colibri.mavlink.setpoints.setpoints import AttitudeSetpoint, Sticks
from colibri.plant.vehicle.description import load_vehicle
from tests.support.states import turned
from tests.support.strategies import quaternions, reals, vectors

INTERVAL_S = 0.008
REFERENCE = AttitudeReference(load_vehicle("hummingbird"), Preview(8_000, 22))
LIMITS = AttitudeLimits()
SLEW = LIMITS.slew
WEIGHT_N = 0.698 * 9.81
NONE = (nan, nan, nan)


LEVEL = turned(0.0, 0.0, 0.0)


def go(
    command: AttitudeCommand, seconds: float, memory: ReferenceMemory | None = None
) -> tuple[ReferenceMemory, np.ndarray]:
    """Let the vehicle be where it is demanded; return the angles demanded at each sample too, degrees."""
    memory = memory or REFERENCE.initial(LEVEL)
    flown = []
    for _ in range(round(seconds / INTERVAL_S)):
        state = turned(*memory.angles.tolist())
        memory, demand = REFERENCE.step(memory, state, command)
        flown.append(np.degrees(demand.angles[0]))
    return memory, np.array(flown)


def test_a_lean_is_reached_soon_without_overshoot() -> None:
    memory, flown = go(tilt_command(radians(20.0), radians(-15.0), 0.0, WEIGHT_N), 0.5)
    assert np.degrees(memory.angles) == pytest.approx([20.0, -15.0, 0.0], abs=0.5)
    assert flown[:, 0].max() <= 20.0
    assert flown[:, 1].min() >= -15.0
    assert (np.diff(flown[:, 0]) >= 0.0).all()


def test_rates_are_bounded_derivatives_of_the_angles() -> None:
    memory, _ = go(tilt_command(radians(-50.0), radians(25.0), -2.0, WEIGHT_N), 1.0)
    for _ in range(100):
        memory, demand = REFERENCE.step(
            memory, turned(*memory.angles.tolist()), tilt_command(radians(50.0), -0.4, 2.0, WEIGHT_N)
        )
        rates = demand.angle_rates_rad_s
        assert np.abs(rates[:, :2]).max() <= SLEW.tilt_rate_rad_s + 1e-9
        assert np.abs(rates[:, 2]).max() <= SLEW.yaw_rate_rad_s + 1e-9
        assert np.abs(np.diff(rates[:, :2], axis=0)).max() <= INTERVAL_S * SLEW.tilt_acceleration_rad_s2 + 1e-9
        assert np.abs(np.diff(rates[:, 2])).max() <= INTERVAL_S * SLEW.yaw_acceleration_rad_s2 + 1e-9
        middle = 0.5 * (rates[1:] + rates[:-1])
        assert np.diff(demand.angles, axis=0) / INTERVAL_S == pytest.approx(middle, abs=1e-9)


def test_the_preview_is_what_follows() -> None:
    memory, command = REFERENCE.initial(LEVEL), attitude_command(quaternion_from_euler(0.4, 0.2, 0.4), 9.0)
    memory, first = REFERENCE.step(memory, LEVEL, command)
    for sample in range(1, 10):
        memory, demand = REFERENCE.step(memory, LEVEL, command)
        for ahead, now in zip(first, demand, strict=True):
            assert now[0] == pytest.approx(ahead[sample], abs=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_body_rates_turn_by_their_integral(axis: int) -> None:
    rate = [0.0, 0.0, 0.0]
    rate[axis] = radians(30.0)
    memory, _ = go(rate_command((rate[0], rate[1], rate[2]), WEIGHT_N), 1.0)
    memory, _ = go(rate_command((0.0, 0.0, 0.0), WEIGHT_N), 1.5, memory)
    assert degrees(memory.angles[axis]) == pytest.approx(30.0, abs=0.1)
    assert np.abs(np.delete(memory.angles, axis)).max() < 1e-9


def test_body_rates_are_those_of_the_body() -> None:
    memory = ReferenceMemory(np.array([radians(40.0), 0.0, 0.0]), np.zeros(3), WEIGHT_N)
    memory, _ = go(rate_command((0.0, 0.0, 0.3), WEIGHT_N), 0.6, memory)
    phi, theta, _ = memory.angles
    expected = [cos(phi) * np.tan(theta) * 0.3, -sin(phi) * 0.3, cos(phi) / cos(theta) * 0.3]
    assert memory.rates == pytest.approx(expected, abs=0.02)


def tilt_deg(angles: Any) -> float:
    return degrees(acos(min(1.0, cos(angles[0]) * cos(angles[1]))))


@pytest.mark.parametrize("rate", [(3.0, 0.0, 0.0), (2.0, -2.0, 0.0), (-1.0, 3.0, 0.0)])
def test_tilt_ends_at_its_limit_and_comes_back_at_once(rate: tuple[float, float, float]) -> None:
    memory, flown = go(rate_command(rate, WEIGHT_N), 2.0)
    assert tilt_deg(memory.angles) == pytest.approx(60.0, abs=1e-6)
    assert max(tilt_deg(np.radians(angles)) for angles in flown) <= 60.0 + 1e-6
    p, q, _ = rate
    memory, _ = go(rate_command((-p, -q, 0.0), WEIGHT_N), 0.3, memory)
    assert tilt_deg(memory.angles) < 50.0


def test_a_pose_is_reached_from_any_side_the_shorter_way() -> None:
    for psi in (radians(170.0), radians(-170.0), radians(90.0)):
        memory, _ = go(attitude_command(quaternion_from_euler(0.3, -0.2, psi), WEIGHT_N), 4.0)
        assert memory.angles == pytest.approx([0.3, -0.2, psi], abs=1e-3)
    around = ReferenceMemory(np.array([0.0, 0.0, radians(360.0 + 170.0)]), np.zeros(3), WEIGHT_N)
    memory, _ = go(attitude_command(quaternion_from_euler(0.0, 0.0, radians(-170.0)), WEIGHT_N), 4.0, around)
    assert degrees(memory.angles[2]) == pytest.approx(550.0, abs=0.1)


def test_a_poses_thrust_points_right_long_before_its_yaw_does() -> None:
    attitude = quaternion_from_euler(radians(25.0), radians(-10.0), radians(150.0))
    memory, _ = go(attitude_command(attitude, WEIGHT_N), 0.7)
    wanted, reached = (
        np.array(rotation_matrix(q))[:, 2] for q in (attitude, quaternion_from_euler(*memory.angles.tolist()))
    )
    assert degrees(memory.angles[2]) < 90.0
    assert degrees(acos(wanted @ reached)) < 1.5


def test_a_pose_upside_down_is_flown_as_far_as_it_goes() -> None:
    memory, _ = go(attitude_command(quaternion_from_euler(radians(120.0), 0.0, 0.0), WEIGHT_N), 2.0)
    assert np.degrees(memory.angles) == pytest.approx([60.0, 0.0, 0.0], abs=0.01)
    memory, _ = go(attitude_command((0.0, 1.0, 0.0, 0.0), WEIGHT_N), 2.0)
    assert tilt_deg(memory.angles) == pytest.approx(0.0, abs=0.01)


def test_a_poses_yaw_rate_leads_it() -> None:
    memory = REFERENCE.initial(LEVEL)
    for _ in range(250):
        command = attitude_command(quaternion_from_euler(0.0, 0.0, memory.angles[2]), WEIGHT_N, 0.5)
        memory, _ = REFERENCE.step(memory, turned(*memory.angles.tolist()), command)
    assert memory.rates[2] == pytest.approx(0.5, abs=0.01)


def test_yaw_does_not_run_away_from_a_vehicle_that_cannot_turn() -> None:
    memory, stuck = REFERENCE.initial(LEVEL), turned(0.0, 0.0, 0.1)
    for _ in range(500):
        memory, demand = REFERENCE.step(memory, stuck, tilt_command(0.0, 0.0, 1.5, WEIGHT_N))
        assert abs(demand.angles[0, 2] - 0.1) <= LIMITS.yaw_ahead_rad + 1e-12


def test_thrust_is_slewed_and_may_carry_the_weight() -> None:
    memory = REFERENCE.initial(LEVEL)._replace(thrust_n=3.0)
    _, demand = REFERENCE.step(memory, LEVEL, tilt_command(0.0, 0.0, 0.0, 19.0))
    assert demand.thrust_n[:2] == pytest.approx([3.0, 3.0 + SLEW.thrust_rate_n_s * INTERVAL_S])
    assert demand.thrust_n.max() == 19.0
    memory, _ = go(tilt_command(radians(40.0), 0.0, 0.0, nan), 1.0)
    assert memory.thrust_n * cos(memory.angles[0]) == pytest.approx(WEIGHT_N, rel=1e-6)


def test_the_sticks_middle_hovers() -> None:
    assert REFERENCE.thrust_for_stick(0.5) == pytest.approx(WEIGHT_N)
    assert REFERENCE.thrust_for_stick(0.0) == 0.0
    assert REFERENCE.thrust_for_stick(1.0) == pytest.approx(4.0 * 6.9472e-6 * 838.0**2)
    assert REFERENCE.thrust_for_stick(0.25) == pytest.approx(0.5 * WEIGHT_N)
    assert REFERENCE.thrust_for_stick(0.75) == pytest.approx(0.5 * (WEIGHT_N + REFERENCE.max_thrust_n))
    assert REFERENCE.thrust_for_stick(-1.0) == 0.0
    assert REFERENCE.thrust_for_stick(2.0) == pytest.approx(REFERENCE.max_thrust_n)


def test_sticks_say_what_pilots_mean() -> None:
    """Forward is nose down, right is right side down, yaw right is clockwise."""
    command = REFERENCE.from_sticks(Sticks(pitch=1.0, roll=0.5, thrust=0.5, yaw=0.1))
    memory, _ = go(command, 2.0)
    phi, theta, _ = memory.angles.tolist()
    up = np.array(rotation_matrix(quaternion_from_euler(phi, theta, 0.0)))[:, 2]
    assert up[0] > 0.5, "thrust forward"
    assert up[1] < -0.2, "thrust to the right"
    assert memory.angles[2] < 0.0
    assert np.degrees(memory.angles[:2]) == pytest.approx([17.5, 35.0], abs=0.01)
    assert command.thrust_n == pytest.approx(WEIGHT_N)


def test_setpoints_of_a_client() -> None:
    attitude = quaternion_from_euler(0.3, 0.1, 0.5)
    memory, _ = go(REFERENCE.from_setpoint(AttitudeSetpoint(attitude, NONE, 0.5)), 4.0)
    assert memory.angles == pytest.approx([0.3, 0.1, 0.5], abs=1e-3)
    assert memory.thrust_n == pytest.approx(WEIGHT_N)
    rates = REFERENCE.from_setpoint(AttitudeSetpoint(None, (nan, 0.2, nan), 0.75))
    assert rates == rate_command((0.0, 0.2, 0.0), REFERENCE.thrust_for_stick(0.75))
    fed = REFERENCE.from_setpoint(AttitudeSetpoint(attitude, (9.0, 9.0, 0.4), nan))
    assert fed.yaw_rate_rad_s == 0.4
    assert np.isnan(fed.thrust_n)


FREE = AttitudeReference(load_vehicle("hummingbird"), Preview(8_000, 22), attitude_limits(Behaviour(), free=True))


@pytest.mark.parametrize("angles", [(pi, 0.0, 1.0), (0.0, pi, 1.0), (2.5, 0.4, 1.0), (0.0, -2.5, 1.2)])
def test_any_attitude_is_reached_if_tilt_is_free(angles: tuple[float, float, float]) -> None:
    wanted = quaternion_from_euler(*angles)
    memory, before = FREE.initial(turned(0.0, 0.0, 1.0)), np.zeros(2)
    for command in [attitude_command(wanted, nan)] * 200 + [
        attitude_command(quaternion_from_euler(0, 0, 1.0), nan)
    ] * 200:
        memory, demand = FREE.step(memory, turned(*memory.angles.tolist()), command)
        assert np.abs(demand.angles[0, :2] - before).max() < 0.07, "no jump"
        assert demand.thrust_n.max() < 2.1 * WEIGHT_N
        before = demand.angles[0, :2].copy()
        if command.vector[2] < 0.99:
            furthest = quaternion_from_euler(*memory.angles.tolist())
    assert abs(np.dot(furthest, wanted)) > 0.999
    assert np.abs(np.cos(memory.angles[:2])) == pytest.approx(1.0)
    memory, demand = FREE.step(
        FREE.initial(turned(0.0, 0.0, 1.0))._replace(angles=np.array((0.0, pi, 1.0))),
        LEVEL,
        tilt_command(0.0, 0.0, 0.0, nan),
    )
    assert np.isfinite(demand.angles).all()


def test_it_begins_where_the_vehicle_is() -> None:
    memory = REFERENCE.initial(turned(0.2, -0.3, 7.0))._replace(thrust_n=8.0)
    assert memory.angles == pytest.approx([0.2, -0.3, 7.0])
    assert memory.thrust_n == 8.0
    steep = REFERENCE.initial(turned(radians(170.0), 0.0, 1.0))
    assert tilt_deg(steep.angles) <= 60.0 + 1e-6
    assert steep.thrust_n == pytest.approx(WEIGHT_N)


STICKS = st.builds(Sticks, reals(1.0), reals(1.0), st.floats(0.0, 1.0), reals(1.0))
MAYBE = st.just(nan) | reals(35.0)
SETPOINTS = st.builds(
    AttitudeSetpoint, st.none() | quaternions(), st.tuples(MAYBE, MAYBE, MAYBE), st.just(nan) | st.floats(0.0, 1.0)
)


@given(quaternions(), vectors(100.0), st.lists(STICKS | SETPOINTS, min_size=1, max_size=8), st.integers(1, 60))
def test_whatever_is_asked_for_the_demand_keeps_its_limits(
    attitude: Quaternion, rate: Any, asked: list[Sticks | AttitudeSetpoint], samples: int
) -> None:
    state = VehicleState((0.0, 0.0, 0.0), rate, attitude, euler_from_quaternion(attitude), rate)
    memory = REFERENCE.initial(state)
    for wished in asked:
        command = REFERENCE.from_sticks(wished) if isinstance(wished, Sticks) else REFERENCE.from_setpoint(wished)
        for _ in range(samples):
            memory, demand = REFERENCE.step(memory, state, command)
        check(demand)


def check(demand: AttitudeDemand) -> None:
    assert all(np.isfinite(part).all() for part in demand)
    assert (np.cos(demand.angles[:, 0]) * np.cos(demand.angles[:, 1])).min() >= 0.5 - 1e-9
    assert np.abs(demand.angle_rates_rad_s[:, :2]).max() <= SLEW.tilt_rate_rad_s * 1.5
    assert np.abs(demand.angle_rates_rad_s[:, 2]).max() <= SLEW.yaw_rate_rad_s + 1e-9
    assert demand.thrust_n.min() >= 0.0
    assert demand.thrust_n.max() <= max(REFERENCE.max_thrust_n, 2.0 * WEIGHT_N) + 1e-9
