"""The whole-vehicle law: flown over its own model's plant, and what flies when there is no plan."""

from math import pi, radians

import numpy as np
import pytest

from colibri.autopilot.control.interface import Fallback
from colibri.autopilot.control.qp import QpResult, QpSolver, QpStatus
from colibri.autopilot.guidance.trajectories.planner import Planner
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.common.types import Vector
from colibri.plant.physics.start import Start
from tests.support.lpv_mpc import HOVERING, TABLE, VEHICLE, Flight


def test_a_lemniscate_is_followed_to_a_tenth_of_a_millimetre() -> None:
    along_m_s = 4.0 * 2.0 * pi / 6.0
    flight = Flight(HOVERING._replace(vx=along_m_s, vy=along_m_s))
    errors = flight.follow("lemniscate:lap=6,height=20", 6.0)
    assert errors[-375:].max() < 2e-4
    assert {decision.diagnostics.fallback for decision in flight.decisions} == {None}


@pytest.mark.parametrize("start", [{"x": -12.0}, {"x": 8.0, "z": 32.0}])
def test_from_far_away_it_comes_without_overshoot(start: dict[str, float]) -> None:
    flight = Flight(HOVERING._replace(**start))
    away = np.array([start.get("x", 0.0), 0.0, start.get("z", 20.0) - 20.0])
    beyond, last = 0.0, np.inf
    planner = Planner(track("hover:height=20"), "by-formula", flight.law.preview)
    for _ in range(1000):
        flight.take(*flight.law.step(flight.memory, 0, flight.state(), planner.horizon(flight.world.time_us)))
        left = np.array(flight.state().position_enu_m) - (0.0, 0.0, 20.0)
        beyond, last = max(beyond, float(-left @ away) / float(np.linalg.norm(away))), float(np.linalg.norm(left))
    assert beyond < 0.06
    assert last < 0.01


@pytest.mark.parametrize("turned", [{"phi": 170.0}, {"theta": -120.0, "p": 6.0, "q": 6.0, "r": 5.0}])
def test_it_recovers_from_any_attitude(turned: dict[str, float]) -> None:
    flight = Flight(HOVERING._replace(**turned))
    errors = flight.follow("hover:height=20", 3.0)
    assert flight.decisions[0].diagnostics.fallback is Fallback.RECOVERY
    assert errors.max() < 2.5
    assert errors[-1] < 0.01


def test_an_attitude_and_a_thrust_are_held() -> None:
    flight = Flight(HOVERING._replace(z=80.0))
    flight.hold(0.3, -0.2, 9.0, 1.5)
    assert flight.state().euler == pytest.approx((0.3, -0.2, 0.0), abs=0.01)
    speeds = np.array(flight.world.rotor_speeds)
    assert (VEHICLE.allocation()[0] * speeds**2).sum() == pytest.approx(9.0, rel=0.01)


def failing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(QpSolver, "solve", lambda *_: QpResult(QpStatus.TIME_OUT, None))
    monkeypatch.setattr("colibri.autopilot.control.lpv_mpc.mpc.solution.plan", lambda *_: (False, False, 0))


def test_fallbacks_are_shifted_plan_then_recovery(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight(HOVERING._replace(x=0.3))
    flight.follow("hover:height=20", 0.04)
    failing(monkeypatch)
    errors = flight.follow("hover:height=20", 4.0)
    how = [decision.diagnostics.fallback for decision in flight.decisions]
    assert how[:5] == [None] * 5
    assert how[5:10] == [Fallback.SHIFTED_PLAN] * TABLE["fallback"]["shifted_samples"]
    assert set(how[10:]) == {Fallback.RECOVERY}
    assert {decision.diagnostics.qp_status for decision in flight.decisions[5:]} == {QpStatus.TIME_OUT}
    assert errors[-1] < 0.1


def test_what_the_battery_gives_bounds_its_commands() -> None:
    flight = Flight(HOVERING._replace(z=2.0))
    flight.memory = flight.law.with_charge(flight.memory, 2.0)
    flight.follow("hover:height=40", 0.2)
    planned = flight.decisions[-1].diagnostics.planned_squared
    assert planned is not None
    full = VEHICLE.battery
    assert full is not None
    empty = 9.0 + (full.full_voltage_v - full.empty_voltage_v) * (1.0 - 2.0 / full.capacity_ah)
    assert planned.max() < (empty / full.full_voltage_v) ** 2
    assert flight.law.charge_ah(flight.memory) > 2.0


@pytest.mark.parametrize("off_m", [(0.25, 0.0, 0.3), (0.25, 0.1, 0.2), (0.5, 0.1, 0.4)])
def test_on_the_ground_it_does_not_tip_over(off_m: Vector) -> None:
    """The estimate has it too high, and aside of where it is to be: the reference is below the ground."""
    flight = Flight(Start(x=0.0, y=0.0, z=0.0, psi=0.0, rotors=4740.0))
    flight.off_m = off_m
    flight.follow("hover:height=0", 2.0)
    phi, theta, _ = flight.state().euler
    assert max(abs(phi), abs(theta)) < radians(0.1)
    assert max(decision.rotor_speeds.max() for decision in flight.decisions[-50:]) < 0.8 * VEHICLE.hover_speed
