"""The flight profile's control law: its plans, and what flies when there is none."""

from math import radians
from typing import Any

import msgspec
import numpy as np
import pytest

from colibri.autopilot.control.interface import Decision, Fallback, VehicleState
from colibri.autopilot.control.lpv_mpc.law import LpvMpc
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.qp import Qp, QpResult, QpSolver, QpStatus
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.rotations import quaternion_from_euler
from colibri.common.types import Vector
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from tests.support.states import turned

VEHICLE = load_vehicle("hummingbird")
TABLE = load_profile("flight").table("lpv-mpc")
START = (2.0, 0.0, 2.0)
ON_SPIRAL = VehicleState(START, (0.0, 0.314, 0.03), quaternion_from_euler(0, 0, 1.57), (0, 0, 1.57), (0, 0, 0))


def build(vehicle: Vehicle = VEHICLE, attitude: dict[str, Any] | None = None) -> tuple[LpvMpc, Planner]:
    table = {**TABLE, "attitude": {**TABLE["attitude"], **(attitude or {})}}
    controller = LpvMpc(table, vehicle, lambda: 0.0)
    return controller, Planner(track("spiral"), "by-formula", controller.preview)


def steps(controller: LpvMpc, planner: Planner, state: VehicleState, count: int) -> list[Decision]:
    memory, decisions = controller.initial(VEHICLE.hover_speed), []
    for sample in range(count):
        time_us = sample * controller.control_interval_us
        memory, decision = controller.step(memory, time_us, state, planner.horizon(0))
        decisions.append(decision)
    return decisions


def leaning(phi_deg: float, theta_deg: float, rate: Vector = (0.0, 0.0, 0.0)) -> VehicleState:
    return turned(radians(phi_deg), radians(theta_deg), position=START, rate=rate)


def failing(monkeypatch: pytest.MonkeyPatch, status: QpStatus, after: int) -> None:
    solve, calls = QpSolver.solve, []

    def solve_at_first(self: QpSolver, qp: Qp) -> QpResult:
        calls.append(1)
        return solve(self, qp) if len(calls) <= after else QpResult(status, None)

    monkeypatch.setattr(QpSolver, "solve", solve_at_first)


@pytest.mark.parametrize("status", [QpStatus.INFEASIBLE, QpStatus.TIME_OUT, QpStatus.NOT_ACCURATE])
def test_fallbacks_are_shifted_plan_then_lqr_then_descent(monkeypatch: pytest.MonkeyPatch, status: QpStatus) -> None:
    controller, planner = build()
    failing(monkeypatch, status, after=3)
    decisions = steps(controller, planner, ON_SPIRAL, 40)
    settings = TABLE["fallback"]
    expected = (
        [None] * 3
        + [Fallback.SHIFTED_PLAN] * settings["shifted_samples"]
        + [Fallback.LQR] * settings["lqr_samples"]
        + [Fallback.DESCENT] * 7
    )
    assert [decision.diagnostics.fallback for decision in decisions] == expected
    assert {decision.diagnostics.qp_status for decision in decisions[3:]} == {status}
    for decision in decisions:
        assert ((decision.rotor_speeds >= 83.8) & (decision.rotor_speeds <= 838.0)).all()


@pytest.mark.parametrize("airborne", [True, False])
def test_the_mass_is_followed_only_in_the_air(airborne: bool) -> None:
    controller, planner = build()
    memory = controller.initial(VEHICLE.hover_speed)
    falling = ON_SPIRAL._replace(velocity_enu_m_s=(0.0, 0.314, -0.1), airborne=airborne)
    for state in (ON_SPIRAL, falling):
        memory, decision = controller.step(memory, 0, state, planner.horizon(0))
    assert (controller.mass_kg(memory) > VEHICLE.body.mass_kg) is airborne
    assert decision.diagnostics.mass_kg == controller.mass_kg(memory)


def test_a_heavier_vehicle_descends_on_more_thrust(monkeypatch: pytest.MonkeyPatch) -> None:
    controller, planner = build()
    failing(monkeypatch, QpStatus.TIME_OUT, after=0)
    memory = controller.initial(VEHICLE.hover_speed)._replace(age=1000)
    squared = []
    for mass_kg in (VEHICLE.body.mass_kg, 1.3 * VEHICLE.body.mass_kg):
        laden = controller.with_mass(memory, mass_kg)
        after, decision = controller.step(laden, 0, ON_SPIRAL._replace(euler=(0.0, 0.0, 1.57)), planner.horizon(0))
        assert decision.diagnostics.fallback is Fallback.DESCENT
        squared.append(after.tracked.wrench[0] - memory.tracked.wrench[0])
    assert squared[1] > 0.0 > squared[0]


def test_the_shifted_plan_is_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    controller, planner = build()
    memory = controller.initial(VEHICLE.hover_speed)._replace(age=1000)
    memory, decision = controller.step(memory, 0, leaning(5.0, -5.0), planner.horizon(0))
    assert (decision.diagnostics.fallback, decision.diagnostics.qp_status) == (None, QpStatus.SOLVED)
    assert memory.plan is not None
    planned = memory.plan.moments[1]
    failing(monkeypatch, QpStatus.TIME_OUT, after=0)
    after, decision = controller.step(memory, 8000, leaning(5.0, -5.0), planner.horizon(0))
    assert decision.diagnostics.fallback is Fallback.SHIFTED_PLAN
    assert (after.moments == planned).all()


@pytest.mark.parametrize("max_speed", [600.0, 838.0])
def test_the_plan_itself_respects_the_rotors(max_speed: float) -> None:
    """Of an upset vehicle, the first of whose plans bind: at every step of the horizon, to the QP's accuracy."""
    rotors = msgspec.structs.replace(VEHICLE.rotors, max_speed=max_speed)
    vehicle = msgspec.structs.replace(VEHICLE, rotors=rotors)
    bound = 0
    for state in (leaning(40, 0), leaning(-30, 30, (4, -4, 2)), leaning(0, -55, (0, 6, 0))):
        for decision in steps(*build(vehicle), state, 5):
            planned = decision.diagnostics.planned_squared
            assert planned is not None
            assert planned.min() >= (83.8 / max_speed) ** 2 - 1e-6
            assert planned.max() <= 1.0 + 1e-6
            assert (decision.rotor_speeds <= max_speed).all()
            bound += decision.diagnostics.active.rotors
    assert bound > 10


@pytest.mark.parametrize("u", [(3.0, 0.0, 0.0), (-2.0, 2.0, 0.5), (0.0, 0.0, -1.0)])
def test_the_qp_after_any_fallback_moments_is_feasible(u: tuple[float, float, float]) -> None:
    """Moments that no rotor could make, further from what one can than the largest increment."""
    controller, planner = build()
    memory = controller.initial(VEHICLE.hover_speed)._replace(moments=np.array(u))
    for thrust_speed in (100.0, VEHICLE.hover_speed, 800.0):
        speeds = np.full(4, thrust_speed / VEHICLE.rotors.max_speed)
        memory = memory._replace(tracked=memory.tracked._replace(speeds=speeds))
        _, decision = controller.step(memory, 0, leaning(20, -30), planner.horizon(0))
        assert decision.diagnostics.qp_status is QpStatus.SOLVED


def test_soft_limits_give_way_only_where_they_must() -> None:
    upset = steps(*build(), leaning(0, 0, (40.0, 0.0, 0.0)), 1)[0].diagnostics
    assert upset.slack > 0.0
    calm = steps(*build(), leaning(20, 0, (3.0, 0.0, 0.0)), 1)[0].diagnostics
    assert calm.qp_status is QpStatus.SOLVED
    assert calm.slack == pytest.approx(0.0, abs=1e-9)


def test_an_excess_that_can_be_avoided_is_avoided_at_any_cost() -> None:
    eager = {"max_rate_rad_s": [1.0, 1.0, 1.0], "output_weight": [100.0, 100.0, 1.0]}
    diagnostics = steps(*build(attitude=eager), leaning(30, 0), 1)[0].diagnostics
    assert diagnostics.active.rates > 0
    assert diagnostics.slack == pytest.approx(0.0, abs=1e-9)
