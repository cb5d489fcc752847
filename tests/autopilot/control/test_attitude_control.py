"""Control laws that are told an attitude: the same law as for a place, the same limits, the same fallbacks."""

from math import radians
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.control.interface import AttitudeController, AttitudeDemand, Fallback
from colibri.autopilot.control.lpv_mpc.law import LpvMpc
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import check_rotor_speeds, load_controller
from colibri.plant.vehicle.description import load_vehicle
from tests.support.states import turned

VEHICLE = load_vehicle("hummingbird")
PROFILE = load_profile("flight")
WEIGHT_N = VEHICLE.body.mass_kg * VEHICLE.gravity_m_s2
LAWS = ("lpv-mpc", "geometric-se3")


def build(name: str = "lpv-mpc") -> Any:
    return load_controller(name)(PROFILE.table(name), VEHICLE, lambda: 0.0)


def mpc() -> LpvMpc:
    controller = build()
    assert isinstance(controller, LpvMpc)
    return controller


def held(samples: int, phi: float, theta: float, psi: float, thrust_n: float = WEIGHT_N) -> AttitudeDemand:
    return AttitudeDemand(np.tile((phi, theta, psi), (samples, 1)), np.zeros((samples, 3)), np.full(samples, thrust_n))


@pytest.mark.parametrize("name", LAWS)
def test_a_level_demand_at_hover_is_hover(name: str) -> None:
    controller = build(name)
    assert isinstance(controller, AttitudeController)
    demand = held(controller.preview.samples, 0.0, 0.0, 0.0)
    memory = controller.initial(VEHICLE.hover_speed)
    _, decision = controller.step_attitude(memory, 0, turned(0.0), demand)
    check_rotor_speeds(name, decision.rotor_speeds, VEHICLE.rotors)
    assert decision.rotor_speeds == pytest.approx(np.full(4, VEHICLE.hover_speed), rel=1e-6)
    assert decision.attitude_reference == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("phi", "theta", "more", "less"), [(0.3, 0.0, 3, 1), (0.0, 0.3, 2, 0), (-0.3, 0.0, 1, 3)])
def test_the_rotors_turn_it_the_right_way(name: str, phi: float, theta: float, more: int, less: int) -> None:
    """Rotors front, right, rear, left: roll right needs the left one, nose down the rear one."""
    controller = build(name)
    demand = held(controller.preview.samples, phi, theta, 0.0)
    _, decision = controller.step_attitude(controller.initial(VEHICLE.hover_speed), 0, turned(0.0), demand)
    assert decision.rotor_speeds[more] > decision.rotor_speeds[less] + 20.0


@pytest.mark.parametrize("name", ["cascade", "global-lpv-mpc"])
def test_laws_that_cannot_do_not_say_that_they_can(name: str) -> None:
    thesis = load_profile("thesis")
    controller = load_controller(name)(thesis.table(name), load_vehicle("hummingbird-thesis"), lambda: 0.0)
    assert not isinstance(controller, AttitudeController)


def test_full_turns_of_yaw_make_no_difference() -> None:
    controller = mpc()
    memory = controller.initial(VEHICLE.hover_speed)
    decisions = [
        controller.step_attitude(memory, 0, turned(radians(5.0), psi=psi), held(30, 0.2, 0.1, wanted))[1]
        for psi, wanted in ((0.3, 0.5), (0.3, 0.5 - 4.0 * np.pi), (0.3 + 6.0 * np.pi, 0.5))
    ]
    for decision in decisions[1:]:
        assert decision.rotor_speeds == pytest.approx(decisions[0].rotor_speeds, abs=1e-6)


@pytest.mark.parametrize("thrust_n", [-5.0, 0.0, 100.0])
def test_thrust_leaves_the_moments_their_room(thrust_n: float) -> None:
    controller = mpc()
    memory, planned = controller.initial(VEHICLE.hover_speed), None
    for sample in range(30):
        memory, decision = controller.step_attitude(
            memory, 8000 * sample, turned(0.0), held(30, 0.4, -0.3, 0.5, thrust_n)
        )
        planned = decision.diagnostics.planned_squared
        assert planned is not None
        assert planned.min() >= (83.8 / 838.0) ** 2 - 1e-6
        assert planned.max() <= 1.0 + 1e-6
    span_n = 4.0 * 6.9472e-6 * 838.0**2
    assert planned is not None
    commanded = float(planned.mean()) * span_n
    assert commanded < 0.1 * span_n if thrust_n <= 0.0 else 0.6 * span_n < commanded < 0.96 * span_n


def test_far_from_the_demand_the_recovery_law_flies() -> None:
    controller = mpc()
    memory = controller.initial(VEHICLE.hover_speed)
    for state in (turned(radians(170.0)), turned(0.0, radians(80.0)), turned(radians(80.0))):
        _, decision = controller.step_attitude(memory, 0, state, held(30, 0.0, 0.0, 0.0))
        assert decision.diagnostics.fallback is Fallback.RECOVERY
    _, decision = controller.step_attitude(memory, 0, turned(radians(50.0)), held(30, 0.0, 0.0, 0.0))
    assert decision.diagnostics.fallback is None
    _, decision = controller.step_attitude(memory, 0, turned(radians(40.0)), held(30, radians(-40.0), 0.0, 0.0))
    assert decision.diagnostics.fallback is Fallback.RECOVERY
