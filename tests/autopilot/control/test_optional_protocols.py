"""What a control law may have beside its interface: a charge that it counts, a mass, and a plan of attitudes."""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from msgspec import structs

from colibri.autopilot.control.interface import (
    ChargeController,
    Controller,
    Decision,
    Diagnostics,
    Horizon,
    MassController,
    Pace,
    PathController,
    PlanColumns,
    PlanController,
    Preview,
    VehicleState,
)
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.registry import load_controller
from colibri.autopilot.ground.forecast import POINTS, Forecaster
from colibri.conformance.interface_checks import OPTIONAL
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from tests.support.states import staying, turned

DOCS = Path(__file__).parents[3] / "docs" / "controllers.md"
HUMMINGBIRD = load_vehicle("hummingbird")
NOTHING = (0.0, 0.0, 0.0)
LEVEL = turned(0.0)
STAYING = staying(8)
LAWS = {"lpv-mpc": "flight", "cascade": "thesis", "global-lpv-mpc": "thesis", "geometric-se3": "se3"}


def law(name: str) -> Controller[Any]:
    return load_controller(name)(load_profile(LAWS[name]).table(name), HUMMINGBIRD, lambda: 0.0)


@pytest.mark.parametrize("name", LAWS)
def test_one_built_in_law_has_charge_mass_and_plan(name: str) -> None:
    controller = law(name)
    assert isinstance(controller, ChargeController) is (name == "lpv-mpc")
    assert isinstance(controller, PlanController) is (name == "lpv-mpc")
    assert isinstance(controller, MassController) is (name == "lpv-mpc")
    assert isinstance(controller, PathController) is (name == "lpv-mpc")


def test_the_flight_law_remembers_the_reported_charge() -> None:
    controller = law("lpv-mpc")
    assert isinstance(controller, ChargeController)
    memory = controller.initial(HUMMINGBIRD.hover_speed)
    assert controller.charge_ah(memory) == 0.0
    assert controller.charge_ah(controller.with_charge(memory, 0.3)) == 0.3
    assert isinstance(controller, PlanController)


class Counted(NamedTuple):
    taken: float


class Counting:
    control_interval_us = 10_000
    preview = Preview(10_000, 1)

    def __init__(self, settings: object, vehicle: Vehicle, clock: object) -> None:
        del settings, clock
        self.speeds = np.full(4, vehicle.hover_speed)

    def initial(self, rotor_speed: float) -> Counted:
        del rotor_speed
        return Counted(0.0)

    def step(self, memory: Counted, time_us: int, state: VehicleState, references: Horizon) -> tuple[Counted, Decision]:
        del time_us, state, references
        return Counted(memory.taken + 1.0), Decision(self.speeds, NOTHING)

    def charge_ah(self, memory: Counted) -> float:
        return memory.taken

    def with_charge(self, memory: Counted, charge_ah: float) -> Counted:
        return memory._replace(taken=charge_ah)


def loop_of(monkeypatch: pytest.MonkeyPatch, factory: Any) -> ControlLoop:
    monkeypatch.setattr("colibri.autopilot.control.loop.load_controller", lambda _: factory)
    profile = load_profile("flight")
    own = structs.replace(profile, controller="own", controllers={**profile.controllers, "own": {}})
    return ControlLoop(own, HUMMINGBIRD, lambda: 0.0)


def test_a_foreign_law_continues_with_the_charge_left(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = loop_of(monkeypatch, Counting)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    loop.decide(0, LEVEL, STAYING)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0, afresh=False)
    assert loop.record().memory == counted(1, monkeypatch)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    assert loop.record().memory == counted(0, monkeypatch)


def counted(steps: int, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """Return the memory of a loop that has flown so many samples."""
    loop = loop_of(monkeypatch, Counting)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    for sample in range(steps):
        loop.decide(sample * 10_000, LEVEL, STAYING)
    return loop.record().memory


def test_a_law_begins_with_what_its_battery_has_told(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = loop_of(monkeypatch, Counting)
    loop.know_charge(0.5)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    before = loop.record().memory
    loop.know_charge(0.5)
    assert loop.record().memory == before
    empty = loop_of(monkeypatch, Counting)
    empty.begin(HUMMINGBIRD.hover_speed, 0.0)
    assert empty.record().memory != before


def test_the_mass_estimate_continues_only_in_mid_flight() -> None:
    loop = ControlLoop(load_profile("flight"), HUMMINGBIRD, lambda: 0.0)
    assert isinstance(loop.controller, MassController)
    references = staying(loop.preview.samples)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    for sample in range(50):
        falling = LEVEL._replace(velocity_enu_m_s=(0.0, 0.0, -0.02 * sample))
        flown_kg = loop.decide(8000 * sample, falling, references).diagnostics.mass_kg
    resumed = ControlLoop(load_profile("flight"), HUMMINGBIRD, lambda: 0.0)
    resumed.resume(loop.record(), seamless=False)
    loop.begin_in_flight(0.0)
    assert loop.decide(0, LEVEL, references).diagnostics.mass_kg == flown_kg > 1.001 * HUMMINGBIRD.body.mass_kg
    assert resumed.decide(0, LEVEL, references).diagnostics.mass_kg == flown_kg
    loop.begin(HUMMINGBIRD.hover_speed, 0.0, afresh=False)
    assert loop.decide(0, LEVEL, references).diagnostics.mass_kg == HUMMINGBIRD.body.mass_kg


class Waiting(Counting):
    min_path_speed = 0.5

    def step_on_path(
        self, memory: Counted, time_us: int, state: VehicleState, references: Horizon
    ) -> tuple[Counted, Decision]:
        del time_us, state, references
        return Counted(memory.taken + 5000.0), Decision(self.speeds, NOTHING)

    def path_speed(self, memory: Counted) -> float:
        return 0.5 if memory.taken else 1.0

    def lag_us(self, memory: Counted) -> int:
        return round(memory.taken)

    def with_lag(self, memory: Counted, lag_us: int) -> Counted:
        return memory._replace(taken=float(lag_us))


def test_the_lag_of_path_time_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = loop_of(monkeypatch, Waiting)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    assert (loop.take_waited_us(), loop.path_speed, loop.lag_us) == (0, 1.0, 0)
    for pace, lag_us in ((Pace.CATCHING_UP, 5000), (Pace.CATCHING_UP, 10_000), (Pace.WAITING, 5000)):
        loop.decide(0, LEVEL, STAYING, pace)
        assert (loop.take_waited_us(), loop.path_speed, loop.lag_us) == (5000, 0.5, lag_us)
    loop.begin_in_flight(0.0)
    assert loop.lag_us == 5000
    loop.decide(0, LEVEL, STAYING, Pace.CLOCK)
    assert loop.take_waited_us() == 0


def test_a_law_that_keeps_to_the_clock_is_not_asked_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Waiting, "min_path_speed", 1.0)
    loop = loop_of(monkeypatch, Waiting)
    loop.begin(HUMMINGBIRD.hover_speed, 0.0)
    loop.decide(0, LEVEL, STAYING, Pace.CATCHING_UP)
    assert (loop.take_waited_us(), loop.lag_us) == (0, 0)


def test_a_plan_is_shown_with_the_columns_of_the_law() -> None:
    plan, squared = np.zeros((21, 6)), np.full((20, 4), HUMMINGBIRD.hover_speed**2 / HUMMINGBIRD.rotors.max_speed**2)
    plan[:, 1] = 0.2
    how = Diagnostics(predicted=plan, planned_squared=squared)
    pitched = Forecaster(HUMMINGBIRD, 0.01, PlanColumns(0, 1, 2, 3)).forecast(LEVEL, None, how)
    assert len(pitched) == POINTS
    assert pitched[-1].position_enu_m[0] > 0.0
    level = Forecaster(HUMMINGBIRD, 0.01, PlanColumns(0, 4, 2, 3)).forecast(LEVEL, None, how)
    assert level[-1].position_enu_m[0] == 0.0


def test_of_a_law_without_a_plan_the_references_are_shown() -> None:
    how = Diagnostics(predicted=np.ones((21, 9)), planned_squared=np.ones((20, 4)))
    shown = Forecaster(HUMMINGBIRD, 0.01, None).forecast(LEVEL, STAYING, how)
    assert [point.position_enu_m for point in shown] == [NOTHING] * POINTS
    assert Forecaster(HUMMINGBIRD, 0.01, None).forecast(LEVEL, None, how) == ()


def test_the_page_names_what_a_law_may_have() -> None:
    rows = re.findall(r"^\| (`.*`) \|", DOCS.read_text(encoding="utf-8"), re.MULTILINE)
    words = " ".join(rows)
    for name in (member for protocol in OPTIONAL for member in protocol.members):
        assert f"`{name}" in words
