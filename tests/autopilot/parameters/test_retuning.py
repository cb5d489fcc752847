from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.control.interface import Decision, Horizon, Preview, VehicleState
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.core.subscription import Subscribers
from colibri.autopilot.parameters.definitions import DESCRIBED, ImpossibleError, Numbers, definitions
from colibri.autopilot.parameters.retuning import Retuning, Tuned, builder
from colibri.common.config import SettingsError
from colibri.mavlink.parameters.store import ParamError, Parameters, Value
from colibri.plant.vehicle.description import Vehicle, load_vehicle
from tests.support.states import staying, turned

NOTHING = (0.0, 0.0, 0.0)


def clock() -> float:
    return 0.0


class Flight:
    def __init__(self, profile: Profile, vehicle: Vehicle) -> None:
        self.build = builder(profile.controller, clock)
        self.law = self.build(profile, vehicle)
        self.said: list[str] = []
        self.tuning = Retuning(Numbers(profile, vehicle), self.build, self.law, self.said.append)
        self.parameters = Parameters(definitions(profile, vehicle), self.tuning.prepare)
        self.memory = self.law.initial(vehicle.hover_speed)
        self.samples = 0

    def step(self) -> Decision:
        state = turned(0.0, position=(0.3, -0.2, 0.1))
        time_us = self.samples * self.law.control_interval_us
        self.memory, decision = self.law.step(self.memory, time_us, state, staying(self.law.preview.samples))
        self.samples += 1
        return decision


def made(parameters: Parameters) -> Tuned | None:
    tuned = parameters.take_made()
    assert tuned is None or isinstance(tuned, Tuned)
    return tuned


@pytest.fixture
def flight() -> Flight:
    return Flight(load_profile("flight").with_choices("lpv-mpc", None), load_vehicle("hummingbird"))


def test_a_retuned_law_keeps_the_memory_of_the_old_one(flight: Flight) -> None:
    for _ in range(5):
        flight.step()
    assert flight.parameters.set("LPV_POLE1", -8.0) is None
    assert flight.parameters.set("VEH_MASS", 0.75) is None
    tuned = made(flight.parameters)
    assert tuned is not None
    assert made(flight.parameters) is None
    assert tuned.vehicle.body.mass_kg == 0.75
    assert tuned.profile.table("lpv-mpc")["guidance"]["poles"] == [-8.0, -8.0]
    memory, before = flight.memory, flight.step()
    flight.law, flight.memory = tuned.controller, memory
    after = flight.step()
    assert after.diagnostics.fallback is None
    assert after.diagnostics.planned_squared is not None
    assert before.diagnostics.planned_squared is not None
    assert not np.allclose(after.diagnostics.planned_squared, before.diagnostics.planned_squared)
    flight.law, flight.memory = flight.build(tuned.profile, tuned.vehicle), memory
    np.testing.assert_array_equal(flight.step().rotor_speeds, after.rotor_speeds)


@pytest.mark.parametrize(("name", "value"), [("VEH_MASS", 50.0), ("VEH_IZZ", 900.0), ("VEH_BAT_EMPTY", 99.0)])
def test_what_cannot_be_together_is_refused(flight: Flight, name: str, value: float) -> None:
    before = flight.parameters.values
    assert flight.parameters.set(name, value) == ParamError.VALUE_OUT_OF_RANGE
    assert flight.parameters.values == before
    assert made(flight.parameters) is None


STAYS_IN_FLIGHT = {"LPV_TILT_MAX"}  # without a tilt limit the law needs a longer preview, which stays in flight


COMPILES = {"LPV_PATH_MIN"}  # a law on the path has machine code of its own


@pytest.mark.parametrize(
    ("controller", "kept"),
    [*((name, COMPILES) for name in DESCRIBED), pytest.param("lpv-mpc", set(), marks=pytest.mark.long)],
)
def test_each_number_can_be_at_its_bounds_or_is_refused(controller: str, kept: set[str]) -> None:
    flight = Flight(load_profile("flight").with_choices(controller, None), load_vehicle("hummingbird"))
    numbers = {number.name for number in DESCRIBED[controller]} - kept
    refused = set()
    for parameter in flight.parameters:
        if parameter.name not in numbers and not parameter.name.startswith("VEH_"):
            continue
        for bound in (parameter.minimum, parameter.maximum):
            if flight.parameters.set(parameter.name, bound) is not None:
                refused.add(parameter.name)
        flight.parameters.set(parameter.name, parameter.default)
    assert {name for name in refused if not name.startswith("VEH_")} <= STAYS_IN_FLIGHT


def test_subscribers_receive_each_change_once(flight: Flight) -> None:
    handed: list[str] = []
    subscribers = Subscribers(
        parameters=(lambda _: handed.append("parameters"),),
        behaviour=(lambda flies_by: handed.append(f"cruise {flies_by.limits.speed_m_s:g}"),),
        law=(lambda _, vehicle: handed.append(f"law for {vehicle.body.mass_kg:g} kg"),),
        vehicle=(lambda vehicle: handed.append(f"vehicle of {vehicle.body.mass_kg:g} kg"),),
        values=flight.parameters.values,
        tuned=Tuned(load_profile("flight"), load_vehicle("hummingbird"), flight.law),
    )
    subscribers.adopt(flight.parameters)
    assert handed == []
    flight.parameters.set("MPC_XY_CRUISE", 3.0)
    subscribers.adopt(flight.parameters)
    assert handed == ["parameters", "cruise 3"]
    handed.clear()
    flight.parameters.set("VEH_MASS", 0.75)
    subscribers.adopt(flight.parameters)
    subscribers.adopt(flight.parameters)
    assert handed == ["parameters", "cruise 3", "law for 0.75 kg", "vehicle of 0.75 kg"]


def test_the_way_back_is_bit_for_bit(flight: Flight) -> None:
    flight.parameters.set("VEH_MASS", 0.75)
    flight.parameters.set("VEH_MASS", flight.parameters.default("VEH_MASS"))
    tuned = made(flight.parameters)
    assert tuned is not None
    assert tuned.vehicle == load_vehicle("hummingbird")


@pytest.mark.parametrize("value", [0.0, -4.0])
def test_a_law_that_nobody_described_refuses_for_itself(value: float) -> None:
    flight = Flight(load_profile("se3"), load_vehicle("hummingbird-thesis"))
    assert flight.parameters.set("GEO_POSIT_FREQU", value) == ParamError.VALUE_OUT_OF_RANGE
    assert flight.said == ["GEO_POSIT_FREQU not changed: position_frequency_rad_s: Expected `float` > 0.0"]
    assert flight.parameters.set("GEO_POSIT_FREQU", 5.0) is None


def test_the_rhythm_of_a_law_cannot_change() -> None:
    flight = Flight(load_profile("thesis"), load_vehicle("hummingbird-thesis"))
    (name,) = (parameter.name for parameter in flight.parameters if "position.samples" in parameter.details)
    assert flight.parameters.set(name, 2) == ParamError.PERMISSION_DENIED
    assert flight.parameters[name] == 4


class Faulty:
    control_interval_us = 10_000
    preview = Preview(10_000, 1)

    def __init__(self, table: Mapping[str, Any]) -> None:
        self.way = table["way"]
        if self.way == 1.0:
            raise SettingsError("way: not this one")
        if self.way == 2.0:
            raise ZeroDivisionError
        if self.way == 6.0:
            raise KeyError("nobody has this")

    def initial(self, rotor_speed: float) -> float:
        return rotor_speed

    def step(self, memory: float, time_us: int, state: VehicleState, references: Horizon) -> tuple[float, Decision]:
        del time_us, state, references
        speeds = {3.0: float("nan"), 4.0: -1.0, 5.0: 1e9}.get(self.way, memory)
        return memory, Decision(np.full(4, speeds), NOTHING)


@pytest.mark.parametrize(
    ("way", "said"),
    [
        (1.0, "way: not this one"),
        (2.0, "ZeroDivisionError"),
        (3.0, "controller faulty gave rotor speeds [nan nan nan nan]: expected 4 from 0 to 838"),
        (4.0, "controller faulty gave rotor speeds [-1. -1. -1. -1.]: expected 4 from 0 to 838"),
        (5.0, "controller faulty gave rotor speeds [1.e+09 1.e+09 1.e+09 1.e+09]: expected 4 from 0 to 838"),
        (6.0, "KeyError: 'nobody has this'"),
    ],
)
def test_a_law_that_fails_is_not_flown_and_says_why(way: Value, said: str) -> None:
    parameters, words = faulty()
    assert parameters.set("FAU_WAY", way) == ParamError.VALUE_OUT_OF_RANGE
    assert parameters["FAU_WAY"] == 0.0
    assert made(parameters) is None
    assert words == [f"FAU_WAY not changed: {said}"]


def faulty() -> tuple[Parameters, list[str]]:
    vehicle = load_vehicle("hummingbird")
    table = {"way": 0.0}
    profile = Profile(
        name="mine",
        controller="faulty",
        references="by-formula",
        controllers={"faulty": table},
        simulation=load_profile("flight").simulation,
    )
    words: list[str] = []
    numbers = Numbers(profile, vehicle)
    tuning = Retuning(numbers, lambda profile, _: Faulty(profile.table("faulty")), Faulty(table), words.append)
    return Parameters(definitions(profile, vehicle), tuning.prepare), words


class Rigid:
    def is_ready(self, vehicle: Vehicle) -> bool:
        return vehicle.body.mass_kg > 0.0

    def try_vehicle(self, vehicle: Vehicle) -> None:
        raise SettingsError(f"nothing flies {vehicle.body.mass_kg:g} kg")

    def try_values(self, parameters: Parameters) -> None:
        del parameters
        raise ZeroDivisionError


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("VEH_MASS", 0.75, "VEH_MASS not changed: nothing flies 0.75 kg"),
        ("MPC_JERK_MAX", 13.0, "MPC_JERK_MAX not changed: ZeroDivisionError"),
    ],
)
def test_what_a_part_cannot_be_built_by_is_refused_in_words(name: str, value: float, said: str) -> None:
    profile, vehicle = load_profile("flight"), load_vehicle("hummingbird")
    build, words = builder(profile.controller, clock), list[str]()
    parameters = Parameters(definitions(profile, vehicle))
    tuning = Retuning(Numbers(profile, vehicle), build, build(profile, vehicle), words.append, parameters, Rigid())
    parameters.ask(tuning.prepare)
    assert parameters.set(name, value) == ParamError.VALUE_OUT_OF_RANGE
    assert parameters[name] == parameters.default(name)
    assert words == [said]
    with pytest.raises(ImpossibleError):
        tuning.try_all({**parameters.values, name: value})


def test_a_change_that_a_subscriber_cannot_adopt_is_taken_back(flight: Flight) -> None:
    adopted: list[float] = []

    def adopt(vehicle: Vehicle) -> None:
        if vehicle.body.mass_kg == 0.75:
            raise ValueError("no")
        adopted.append(vehicle.body.mass_kg)

    tuned = Tuned(load_profile("flight"), load_vehicle("hummingbird"), flight.law)
    values = flight.parameters.values
    subscribers = Subscribers(parameters=(), behaviour=(), law=(), vehicle=(adopt,), values=values, tuned=tuned)
    assert flight.parameters.set("VEH_MASS", 0.75) is None
    with pytest.raises(ValueError, match="no"):
        subscribers.adopt(flight.parameters)
    subscribers.keep(flight.parameters)
    assert flight.parameters["VEH_MASS"] == flight.parameters.default("VEH_MASS")
    assert adopted == [0.698]
