from dataclasses import fields
from math import radians
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colibri.autopilot.control.law_files import table_of
from colibri.autopilot.control.profile import Profile, load_profile
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.integrator_chain import Limits
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.parameters.behaviour import BY_IDENTITY, ROWS, TRACKS
from colibri.autopilot.parameters.definitions import (
    DESCRIBED,
    STRUCTURE,
    Numbers,
    behaviour,
    definitions,
    law_numbers,
    vehicle_numbers,
)
from colibri.autopilot.parameters.number_paths import described, paths, read
from colibri.mavlink.parameters.store import ParamError, Parameters, ParamType
from colibri.plant.vehicle.description import Vehicle, load_vehicle

HUMMINGBIRD = load_vehicle("hummingbird")
FLIGHT = load_profile("flight").of(HUMMINGBIRD)
NOT_IN_FLIGHT = {
    "lpv-mpc": {
        *("control_interval_s", "qp.tolerance", "plan.check_every", "plan.count_every", "path.max_speed"),
        *(f"plan.blocks[{place}]" for place in range(6)),
    }
}


def parameters_of(profile: Profile = FLIGHT, vehicle: Vehicle = HUMMINGBIRD) -> Parameters:
    return Parameters(definitions(profile, vehicle))


def differences(before: Any, after: Any) -> set[str]:
    numbers = list(paths(before))
    assert numbers == list(paths(after))
    return {described(path) for path in numbers if read(before, path) != read(after, path)}


@pytest.mark.parametrize("controller", ["lpv-mpc", "geometric-se3", "cascade", "global-lpv-mpc"])
@pytest.mark.parametrize("vehicle", ["hummingbird", "hummingbird-thesis"])
def test_there_are_parameters_for_every_law_and_vehicle(controller: str, vehicle: str) -> None:
    profile = load_profile("flight" if controller in FLIGHT.controllers else "thesis").with_choices(controller, None)
    parameters = parameters_of(profile, load_vehicle(vehicle))
    assert all(parameter.description and parameter.group for parameter in parameters)
    for name in ("MIS_TAKEOFF_ALT", "RTL_RETURN_ALT", "FLW_TGT_HT", "FLW_TGT_DST", "FLW_TGT_FA", "FLW_TGT_RS"):
        assert parameters.at(parameters.index(name) or 0).kind == ParamType.REAL  # type: ignore[union-attr]
    for name in ("FLW_TGT_ALT_M", "SYS_FAILURE_EN", "MAV_SYS_ID", "TRACK"):
        assert isinstance(parameters[name], int)


@pytest.mark.parametrize("controller", DESCRIBED)
def test_every_changeable_profile_number_is_a_parameter(controller: str) -> None:
    table = FLIGHT.table(controller)
    there = {described(path) for path in paths(table)}
    numbers = law_numbers(controller, table)
    assert numbers == list(DESCRIBED[controller])
    assert there - {described(number.path) for number in numbers} == NOT_IN_FLIGHT[controller]


def test_vehicle_numbers_are_parameters() -> None:
    tree = msgspec.to_builtins(HUMMINGBIRD)
    no_parameters = {("ground",), ("sensors",), ("drag", "quadratic_n_s2_m2"), ("drag", "learned")}
    there = {described(path) for path in paths(tree) if not {path[:1], path[:2]} & no_parameters}
    assert there == {described(number.path) for number in vehicle_numbers(tree)}


def test_a_vehicle_has_no_parameters_for_what_it_does_not_model() -> None:
    parameters = parameters_of(vehicle=HUMMINGBIRD.without(["battery", "drag", "rotor-lag"]))
    assert not any(parameter.name.startswith(("VEH_BAT", "VEH_DRAG", "VEH_LAG")) for parameter in parameters)


def test_defaults_leave_everything_as_it_is() -> None:
    profile, vehicle = Numbers(FLIGHT, HUMMINGBIRD).applied(parameters_of().values)
    assert profile is FLIGHT
    assert vehicle is HUMMINGBIRD


@pytest.mark.parametrize("controller", DESCRIBED)
def test_each_parameter_of_the_law_changes_its_own_number(controller: str) -> None:
    profile, table = FLIGHT.with_choices(controller, None), FLIGHT.table(controller)
    for number in law_numbers(controller, table):
        parameters = parameters_of(profile)
        name, bound = number.name, number.minimum if read(table, number.path) == number.maximum else number.maximum
        assert parameters.set(name, int(bound) if isinstance(parameters[name], int) else bound) is None
        changed, vehicle = Numbers(profile, HUMMINGBIRD).applied(parameters.values)
        assert vehicle is HUMMINGBIRD
        assert differences(table, changed.table(controller)) == {described(number.path)}
        assert read(changed.table(controller), number.path) == pytest.approx(bound, rel=1e-6)
    assert load_profile("flight").of(HUMMINGBIRD) == FLIGHT


def test_each_parameter_of_the_vehicle_changes_its_own_number() -> None:
    tree = msgspec.to_builtins(HUMMINGBIRD)
    for number in vehicle_numbers(tree):
        parameters = parameters_of()
        before = read(tree, number.path)
        assert parameters[number.name] * number.scale == pytest.approx(before, rel=1e-6)
        assert parameters.set(number.name, 0.9 * parameters[number.name] + 1e-3) is None
        _, vehicle = Numbers(FLIGHT, HUMMINGBIRD).applied(parameters.values)
        after = msgspec.to_builtins(vehicle)
        assert differences(tree, after) == {described(number.path)}
        assert read(after, number.path) == pytest.approx(0.9 * before + 1e-3 * number.scale, rel=1e-6)


def test_units_of_the_vehicle() -> None:
    units = {parameter.name: parameter.unit for parameter in parameters_of(vehicle=load_vehicle("hummingbird-thesis"))}
    assert (units["VEH_CT"], units["VEH_ROT_MAX"]) == ("uN/rpm^2", "rpm")


def test_a_vehicle_outside_our_bounds_has_parameters() -> None:
    big = msgspec.structs.replace(
        HUMMINGBIRD,
        body=msgspec.structs.replace(HUMMINGBIRD.body, mass_kg=500.0),
        rotors=msgspec.structs.replace(HUMMINGBIRD.rotors, thrust_coefficient=0.1),
        ground=None,
    )
    assert parameters_of(vehicle=big)["VEH_MASS"] == 500.0


@pytest.mark.parametrize("kind", [Behaviour, Limits])
def test_every_number_of_the_behaviour_is_a_parameter(kind: Any) -> None:
    names = (
        set(Limits._fields)
        if kind is Limits
        else {field.name for field in fields(Behaviour)} - {"limits", "stick_limits"}
    )
    assert names <= {row.path[-1] for row in ROWS} | set(BY_IDENTITY)


def test_behaviour_is_what_the_parameters_say() -> None:
    parameters = parameters_of()
    assert behaviour(parameters) == Behaviour()
    changes = {"MIS_TAKEOFF_ALT": 4.0, "MPC_XY_CRUISE": 2.0, "MPC_YAWRAUTO_MAX": 90.0, "TRACK": 6, "SYS_FAILURE_EN": 1}
    for name, value in changes.items():
        assert parameters.set(name, value) is None
    now = behaviour(parameters)
    assert now.takeoff_height_m == 4.0
    assert now.limits == Limits()._replace(speed_m_s=2.0, yaw_rate_rad_s=radians(90.0))
    assert now.track == "circle"
    assert now.inject_failures is True
    assert now.land_speed_m_s == Behaviour().land_speed_m_s


def test_each_parameter_of_the_behaviour_changes_its_own_field() -> None:
    for row in ROWS:
        for bound in (row.minimum, row.maximum):
            parameters = parameters_of()
            value = int(bound) if isinstance(parameters[row.name], int) else float(bound)
            assert parameters.set(row.name, value) is None
            now, usual = behaviour(parameters), Behaviour()
            changed = {
                field.name for field in fields(Behaviour) if getattr(now, field.name) != getattr(usual, field.name)
            }
            expected = row.path[0]
            assert changed == (set() if parameters[row.name] == parameters.default(row.name) else {expected})


@pytest.mark.parametrize("name", TRACKS)
def test_every_track_that_can_be_chosen_flies(name: str) -> None:
    assert track(name).duration_s > 0.0


def test_the_system_id_cannot_be_changed() -> None:
    parameters = Parameters(definitions(FLIGHT, HUMMINGBIRD, system_id=3))
    assert parameters["MAV_SYS_ID"] == 3
    assert parameters.set("MAV_SYS_ID", 4) == ParamError.READ_ONLY


def test_names_for_a_law_that_nobody_described() -> None:
    table = {
        "control_interval_s": 0.01,
        "position_frequency_rad_s": 4.0,
        "weights": {"output": [1.0, 2.0], "terminal": 3},
        "enabled": True,
        "solver": "daqp",
        "qp": {"tolerance": 1e-8},
    }
    numbers = law_numbers("my-law", table)
    assert [(number.name, described(number.path), number.unit) for number in numbers] == [
        ("MYL_POSIT_FREQU", "position_frequency_rad_s", "rad/s"),
        ("MYL_WEIGH_OUTPU1", "weights.output[0]", ""),
        ("MYL_WEIGH_OUTPU2", "weights.output[1]", ""),
        ("MYL_WEIGH_TERMI", "weights.terminal", ""),
    ]


TABLES = st.recursive(
    st.floats() | st.integers() | st.text(max_size=3) | st.booleans(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=20), inner, max_size=6),
    max_leaves=20,
)


@settings(max_examples=20)
@given(st.text(max_size=12), st.dictionaries(st.text("ab_s1é", max_size=30), TABLES, max_size=8))
def test_any_table_has_parameters(name: str, table: dict[str, Any]) -> None:
    profile = msgspec.structs.replace(FLIGHT, controller=name + "?", controllers={table_of(name + "?"): table})
    tuned = Numbers(profile, HUMMINGBIRD)
    parameters = Parameters(tuned.definitions)
    numbers = law_numbers(name + "?", table)
    assert all(number.name in parameters for number in numbers)
    assert {number.path for number in numbers} == {path for path in paths(table) if path[0] not in STRUCTURE}
    assert tuned.applied(parameters.values)[0] is profile
