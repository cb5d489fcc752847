"""Vehicle files: the numbers, and what a wrong one gets."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from colibri import plant
from colibri.plant.vehicle.description import VehicleError, load_vehicle
from tests.support.commands import edited

FILE = Path(plant.__file__).parent / "vehicle" / "models" / "hummingbird.toml"


def test_hover_is_at_the_speed_that_carries_the_weight() -> None:
    assert load_vehicle("hummingbird-thesis").hover_speed == pytest.approx(4740.24, abs=0.01)
    assert load_vehicle("hummingbird").hover_speed == pytest.approx(4740.24 * 2 * pi / 60, abs=0.01)


def test_the_allocation_is_the_one_of_the_thesis() -> None:
    vehicle = load_vehicle("hummingbird-thesis")
    cT, cQ, arm = 7.6184e-8, 2.6839e-9, 0.171
    expected = [[cT, cT, cT, cT], [0.0, -cT * arm, 0.0, cT * arm], [-cT * arm, 0.0, cT * arm, 0.0], [-cQ, cQ, -cQ, cQ]]
    assert vehicle.allocation() == pytest.approx(np.array(expected), abs=1e-20)


def test_both_files_describe_the_same_rotors() -> None:
    rpm, si = load_vehicle("hummingbird-thesis"), load_vehicle("hummingbird")
    speeds = np.array([4000.0, 5000.0, 6000.0, 4500.0])
    speeds_si = speeds * 2 * pi / 60
    assert si.allocation() @ speeds_si**2 == pytest.approx(rpm.allocation() @ speeds**2, rel=1e-4)


def test_rotor_momentum_by_the_sense_of_rotation() -> None:
    faster_counter_clockwise = np.array([500.0, 400.0, 500.0, 400.0])
    assert load_vehicle("hummingbird").rotor_momentum() @ faster_counter_clockwise == pytest.approx(200 * 1.302e-6)
    as_printed = load_vehicle("hummingbird-thesis").rotor_momentum() @ faster_counter_clockwise
    assert as_printed == pytest.approx(-200 * 1.302e-6)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("mass_kg = 0.698", "", "body: .*mass_kg"),
        ("mass_kg = 0.698", "mass_kg = 0.698\nweight_n = 7.0", "body: .*weight_n"),
        ("mass_kg = 0.698", "mass_kg = -0.698", "body.mass_kg"),
        ("mass_kg = 0.698", "mass_kg = inf", "body"),
        ("mass_kg = 0.698", "mass_kg = nan", "body"),
        ("mass_kg = 0.698", "mass_kg = 100.0", "rotors.max_speed: hover needs"),
        ("[0.0034, 0.0034, 0.006]", "[0.0034, 0.0034]", "body.inertia_kg_m2"),
        ("[0.0034, 0.0034, 0.006]", "[0.0034, 0.0034, 0.1]", r"nearest valid: \[0.0345"),
        ('speed_unit = "rad/s"', 'speed_unit = "hertz"', "rotors.speed_unit"),
        ('["ccw", "cw", "ccw", "cw"]', '["ccw", "ccw", "ccw", "ccw"]', "position_m, direction"),
        ("[-0.171, 0.0]", "[0.171, 0.0]", "position_m, direction"),
        ("gravity_m_s2 = 9.81", "gravity_m_s2 = ", FILE.name),
        ("foot_depth_m = 0.05", "foot_depth_m = -0.05", "ground.foot_depth_m"),
        ("empty_voltage_v = 9.0", "empty_voltage_v = 13.0", "battery: empty_voltage_v: must not lie above"),
        ("efficiency = 0.75", "efficiency = 1.5", "battery.efficiency"),
        ("time_constant_up_s = 0.0125", "time_constant_up_s = 1e-4", "rotors.lag.time_constant_up_s"),
    ],
)
def test_a_wrong_file_is_refused_by_file_and_key(tmp_path: Path, old: str, new: str, key: str) -> None:
    with pytest.raises(VehicleError, match=key) as error:
        load_vehicle(edited(tmp_path, FILE, old, new))
    assert FILE.name in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(VehicleError, match=r"nowhere\.toml: No such file"):
        load_vehicle("nowhere.toml")
