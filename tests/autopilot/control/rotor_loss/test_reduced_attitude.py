"""The attitude on three rotors: the periodic solution solves the plant's equations, and the gains are an LQR's."""

from math import hypot
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.control.rotor_loss.reduced_attitude import (
    ReducedAttitude,
    ThreeRotorsError,
    balancing_thrust,
    trio_without,
)
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.control.rotor_loss.three_rotors import law_without, shared
from colibri.autopilot.control.vehicle_model.rotor_lag import rotor_lag
from colibri.plant.physics.equations import angular_acceleration
from colibri.plant.vehicle.description import Vehicle, load_vehicle

HUMMINGBIRD = load_vehicle("hummingbird")
INTERVAL_S = 0.008
FOLLOWS = rotor_lag(HUMMINGBIRD, INTERVAL_S).planned
SPIN_RAD_S = 27.0
HOVER = VehicleState((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def law(lost: int, vehicle: str = "hummingbird") -> ReducedAttitude:
    return ReducedAttitude(load_vehicle(vehicle), lost, INTERVAL_S, FOLLOWS, SPIN_RAD_S)


@pytest.mark.parametrize("vehicle", ["hummingbird", "iris"])
@pytest.mark.parametrize("lost", range(4))
def test_the_opposite_rotor_is_of_the_same_hand_and_across(lost: int, vehicle: str) -> None:
    rotors = load_vehicle(vehicle).rotors
    trio = trio_without(load_vehicle(vehicle), lost)
    assert sorted(trio[:4]) == [0, 1, 2, 3]
    assert rotors.direction[trio.o] == rotors.direction[lost]
    assert np.dot(rotors.position_m[trio.o], rotors.position_m[lost]) < 0.0
    assert (trio.sign > 0.0) == (rotors.direction[lost] == "ccw")


@pytest.mark.parametrize("lost", range(4))
@pytest.mark.parametrize("spin", [8.0, 15.0, 27.0, 32.0])
def test_the_periodic_solution_turns_and_stays(lost: int, spin: float) -> None:
    """Both by the plant's own equations: p' = q' = 0, and the direction wanted stands still in the body."""
    attitude = law(lost)
    trio = attitude.trio
    solution = attitude.solution(spin)
    pair_n = 0.5 * (HUMMINGBIRD.body.mass_kg * HUMMINGBIRD.gravity_m_s2 - solution.opposite_n)
    thrust_n = np.zeros(4)
    thrust_n[trio.a] = thrust_n[trio.b] = pair_n
    thrust_n[trio.o] = solution.opposite_n
    speeds = np.sqrt(thrust_n / HUMMINGBIRD.allocation()[0])
    _, mx, my, mz = HUMMINGBIRD.allocation() @ speeds**2
    h = float(HUMMINGBIRD.rotor_momentum() @ speeds)
    rate = (float(solution.rate[0]), float(solution.rate[1]), spin * trio.sign)
    turn = angular_acceleration(rate, (mx, my, mz), h, 0.0, HUMMINGBIRD.body.inertia_kg_m2)
    # Elsewhere the rotors' own momentum, which the law takes to be that of the final spin, is a little different.
    assert hypot(turn[0], turn[1]) < (1e-9 if spin == SPIN_RAD_S else 0.5)
    x, y = solution.h
    direction = np.array([x, y, np.sqrt(1.0 - x * x - y * y)])
    assert np.cross(rate, direction) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("lost", range(4))
def test_at_the_final_spin_drag_and_torque_balance(lost: int) -> None:
    trio = trio_without(HUMMINGBIRD, lost)
    fast, slow = (balancing_thrust(HUMMINGBIRD, trio, spin) for spin in (30.0, 20.0))
    assert 0.0 < fast < slow < 0.5 * HUMMINGBIRD.body.mass_kg * HUMMINGBIRD.gravity_m_s2
    assert law(lost).solution(SPIN_RAD_S).opposite_n == pytest.approx(balancing_thrust(HUMMINGBIRD, trio, SPIN_RAD_S))


@pytest.mark.parametrize("lost", range(4))
def test_on_the_solution_it_asks_for_the_solution(lost: int) -> None:
    attitude = law(lost)
    solution = attitude.solution(20.0)
    x, y = solution.h
    direction = np.array([x, y, np.sqrt(1.0 - x * x - y * y)])
    rate = np.array([*solution.rate, 20.0 * attitude.trio.sign])
    d, f_o = attitude.command(direction, rate, np.array([0.0, solution.opposite_n]))
    assert d == pytest.approx(0.0, abs=1e-12)
    assert f_o == pytest.approx(solution.opposite_n)


@given(st.floats(0.0, 25.0), st.floats(-20.0, 20.0), st.floats(-5.0, 10.0), st.integers(0, 3), st.floats(0.7, 1.0))
def test_what_is_shared_is_within_limits_and_keeps_the_moment(
    thrust_n: float, d: float, f_o: float, lost: int, max_speed: float
) -> None:
    trio = trio_without(HUMMINGBIRD, lost)
    full_n = HUMMINGBIRD.allocation()[0] * HUMMINGBIRD.rotors.max_speed**2
    squared = shared(trio, thrust_n, d, f_o, full_n, (0.01, max_speed**2))
    forces = squared * full_n
    left = [trio.a, trio.b, trio.o]
    assert squared[lost] == 0.0
    assert squared[left].min() >= 0.01 - 1e-12
    assert squared[left].max() <= max_speed**2 + 1e-12
    room = float(full_n[0]) * (max_speed**2 - 0.01)
    assert forces[trio.b] - forces[trio.a] == pytest.approx(min(max(d, -room), room), abs=1e-9)
    if abs(d) < 2.0 and 0.1 < f_o < 2.0 and 6.0 < thrust_n < 6.0 + f_o and max_speed > 0.95:
        assert forces.sum() == pytest.approx(thrust_n)


def with_rotors(**changes: Any) -> Vehicle:
    return structs.replace(HUMMINGBIRD, rotors=structs.replace(HUMMINGBIRD.rotors, **changes))


def test_an_opposite_rotor_without_an_arm_opens_no_cone() -> None:
    """VEH_ROT3_X = 0, say: three rotors in a line."""
    vehicle = with_rotors(position_m=((0.171, 0.0), (0.0, -0.171), (0.0, 0.0), (0.0, 0.171)))
    attitude = law_without(vehicle, 0, INTERVAL_S)
    assert attitude.solution(SPIN_RAD_S).opposite_n == 0.0
    commands = attitude.command(np.array([0.1, 0.0, 0.99]), np.array([0.0, 0.0, SPIN_RAD_S]), np.zeros(2))
    assert np.isfinite(commands).all()


def test_rotors_that_do_not_turn_in_two_pairs_are_refused() -> None:
    vehicle = with_rotors(direction=("ccw", "ccw", "ccw", "cw"))
    with pytest.raises(ThreeRotorsError, match="two pairs"):
        law_without(vehicle, 0, INTERVAL_S)
    rotor_loss = RotorLoss(vehicle, 8000)
    assert rotor_loss.impossible == "its rotors do not turn in two pairs"
    assert not rotor_loss.look(HOVER, (0.5, 0.5, 0.5, 0.5), 0.0, airborne=True, ground_m=-1.0)


def test_a_change_that_prevents_rotor_loss_landing_is_refused() -> None:
    rotor_loss = RotorLoss(HUMMINGBIRD, 8000)
    with pytest.raises(ThreeRotorsError, match="no landing on three rotors"):
        rotor_loss.try_out(with_rotors(direction=("ccw", "ccw", "ccw", "cw")))
    rotor_loss.try_out(with_rotors(strength=(1.0, 0.9, 1.0, 1.0)))
    assert rotor_loss.lost is None


@pytest.mark.parametrize(
    ("height_m", "climb_m_s", "lands"),
    [(0.4, 0.1, True), (0.4, -0.6, False), (5.0, 0.1, False)],
    ids=["slides", "sinks", "drifts"],
)
def test_a_vehicle_that_slides_on_the_ground_has_landed(height_m: float, climb_m_s: float, lands: bool) -> None:
    rotor_loss = RotorLoss(HUMMINGBIRD, 8000)
    state = HOVER._replace(position_enu_m=(0.0, 0.0, height_m), velocity_enu_m_s=(2.0, 0.0, climb_m_s))
    rotor_loss.resume(3, np.full(4, HUMMINGBIRD.hover_speed), state, 0.0, flying=True)
    for _ in range(round(3.1 / INTERVAL_S)):  # 1.5 s until it sinks, and 1.5 s
        rotor_loss.decide(state, 0.0)
    assert rotor_loss.landed is lands
