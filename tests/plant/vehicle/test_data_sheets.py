"""A vehicle from data sheets: complete, in proportion, and refused where a number is missing or impossible."""

import tomllib
from math import hypot
from typing import Any

import msgspec
import pytest

from colibri.campaigns.factors import SCALED, with_keys
from colibri.common.config import read_settings
from colibri.conformance.vehicle_flights import NUMBERS, Trial, fly, lemniscate
from colibri.plant.vehicle.data_sheets import LAYOUTS, ORDERS, DataSheet, propeller_of, thrust_stand_of, vehicle_file
from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle
from tests.support.refusals import refusal_of

X500 = DataSheet("mine", 2.0643, 0.25, propeller_of("1045"), kv_rpm_v=920.0, cells=4, hover_throttle=0.6)
CF21 = DataSheet(
    "cf", 0.0319, 0.046, propeller_of("45mm"), order="clockwise", motor="brushed", kv_rpm_v=14000.0, cells=1,
    hover_throttle=0.65, drag_n_s_m=0.0147,
)  # fmt: skip
ESTIMATED = CF21._replace(drag_n_s_m=None)
STAND = "throttle_percent,Thrust (g),Speed (rpm),Current (A)\n50,300,4000,3\n100,1200,8000,12\n"


def written(sheet: DataSheet) -> Vehicle:
    return read_settings(tomllib.loads(vehicle_file(sheet)[0]), Vehicle)


LARGE = X500._replace(arm_m=0.5)


@pytest.mark.parametrize(
    "sheet",
    [X500, CF21, X500._replace(layout="+"), X500._replace(layout="h", capacity_ah=5.0)]
    + [LARGE._replace(layout=layout, order=order) for layout in LAYOUTS[3:] for order in ORDERS],
)
def test_a_written_vehicle_is_complete(sheet: DataSheet) -> None:
    vehicle = written(sheet)
    assert all((vehicle.drag, vehicle.ground, vehicle.sensors, vehicle.rotors.lag))
    assert (vehicle.battery is None) == (sheet.capacity_ah is None)
    assert all(hypot(x, y) == pytest.approx(sheet.arm_m, rel=1e-4) for x, y, *_ in vehicle.rotors.position_m)
    assert sheet.hover_throttle is not None
    weight_n = sheet.mass_kg * vehicle.gravity_m_s2
    assert vehicle.max_wrench()[0] * sheet.hover_throttle == pytest.approx(weight_n, rel=1e-3)
    found = vehicle.rotors.numbering()
    assert (found.shape, found.reverse) == ("x" if sheet.layout == "h" else sheet.layout, sheet.layout == "h")
    turns = tuple(range(vehicle.rotors.count))
    assert sheet.order != "px4" or found.rotors == turns
    assert found.to_vehicle(found.to_motors(turns)) == turns


def test_lag_and_inertia_are_not_below_those_of_the_true_vehicle() -> None:
    true, found = load_vehicle("crazyflie"), written(CF21)
    assert true.rotors.lag is not None
    assert found.rotors.lag is not None
    assert found.rotors.lag.time_constant_up_s >= true.rotors.lag.time_constant_up_s
    assert all(a >= b for a, b in zip(found.body.inertia_kg_m2, true.body.inertia_kg_m2, strict=True))
    assert found.rotors.direction == true.rotors.direction


@pytest.mark.parametrize(("sheet", "drag"), [(CF21, 1.0), (ESTIMATED, 1.0), (ESTIMATED, 1.6)])
def test_a_vehicle_from_data_sheets_flies_the_true_one(sheet: DataSheet, drag: float) -> None:
    true = load_vehicle("crazyflie")
    options = {"track": lemniscate(true), "plant_vehicle": true}
    assumed = with_keys({f"vehicle.{key}{SCALED}": drag for key in NUMBERS["drag"]}, "vehicle", written(sheet))
    flown = fly(true, Trial(lambda _: options, 12.0), {"profile": "flight"}, assumed)
    assert not flown.lost
    assert flown.error_m < 0.05 * CF21.arm_m


def test_a_thrust_stand_wins_over_estimates() -> None:
    vehicle = written(X500._replace(hover_throttle=None, stand=thrust_stand_of(STAND)))
    assert vehicle.rotors.max_speed == pytest.approx(837.76, rel=1e-4)
    assert vehicle.max_wrench()[0] == pytest.approx(4 * 11.772, rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass_kg": -1.0}, "--mass -1: must lie between"),
        ({"mass_kg": float("nan")}, "--mass nan: must lie between"),
        ({"mass_kg": 9.0, "hover_throttle": None}, "times the weight: at least 1.05"),
        ({"hover_throttle": 60.0}, "--hover-throttle 60: must lie between 0.02 and 0.95"),
        ({"arm_m": 0.15}, "propellers overlap"),
        ({"kv_rpm_v": None, "hover_throttle": None}, "thrust is unknown"),
        ({"cells": 1}, "--motor brushed or brushless is required"),
        ({"cells": None, "capacity_ah": 5.0}, "--capacity requires --cells"),
        ({"name": "iris"}, "choose another"),
        ({"inertia_kg_m2": (1.0, 1.0, 5.0)}, "nearest valid"),
    ],
)
def test_missing_and_impossible_numbers_are_refused(changes: dict[str, Any], message: str) -> None:
    assert message in refusal_of(vehicle_file, X500._replace(**changes))


@pytest.mark.parametrize(
    ("text", "size_m"),
    [("10x4.5", (0.254, 0.1143)), ("1045", (0.254, 0.1143)), ("5045", (0.127, 0.1143)), ("45x30mm", (0.045, 0.03))],
)
def test_propellers_are_read_as_printed(text: str, size_m: tuple[float, float]) -> None:
    assert propeller_of(text)[:2] == pytest.approx(size_m)


@pytest.mark.parametrize("text", ["", "big", "nan", "10x40", "-5x4", "900"])
def test_other_propellers_are_refused(text: str) -> None:
    with pytest.raises(VehicleError, match="must be diameter x pitch"):
        propeller_of(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "column throttle is missing"),
        ("throttle,thrust\n1,3\n", "its unit is missing or unknown"),
        ("throttle,thrust_n\n0.5,3\n", "largest throttle 0.5"),
        ("throttle,thrust_n\n1,many\n", "must have a number in each column"),
        ("throttle,thrust_n\n1,-3\n", "finite and not negative"),
        ("throttle,thrust_n,speed_rpm\n1,3,0\n", "speed at the largest throttle is 0"),
    ],
)
def test_bad_thrust_stands_are_refused(text: str, message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        thrust_stand_of(text)


def test_a_name_with_quotes_is_kept() -> None:
    assert msgspec.toml.decode(vehicle_file(X500._replace(name='my "x"'))[0])["name"] == 'my "x"'
