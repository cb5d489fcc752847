"""Vehicles of every size: each is flown by its file alone, and with a rotor lag of half the true one."""

from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.control.scaling import capability_of, scaled
from colibri.common.config import SettingsError
from colibri.plant.vehicle.description import load_vehicle
from tools.vehicles import fly

FILES = Path(__file__).parent / "vehicles"
TABLE = load_profile("flight").table("lpv-mpc")


@pytest.mark.parametrize(
    ("vehicle", "trial", "rms_m"),
    [
        ("cf21", "half the lag", 0.01),
        ("r26", "half the lag", 0.05),
        ("r26", "weak", 1e-3),
        ("r26", "no lag", 1e-3),
        ("heavy30", "hover", 0.02),
        ("cf21", "at 5 m/s", 0.01),
        ("heavy30", "at 12 m/s", 1e-3),
    ],
)
def test_every_vehicle_flies_by_its_file_alone(vehicle: str, trial: str, rms_m: float) -> None:
    flown = fly(load_vehicle(str(FILES / f"{vehicle}.toml")), trial)
    assert not flown.lost
    assert flown.error_m < rms_m


@pytest.mark.parametrize(
    ("vehicle", "trial"),
    [
        pytest.param("r26", "lemniscate", marks=pytest.mark.long),
        ("cf21", "loaded"),
        pytest.param("heavy30", "sensors", marks=pytest.mark.long),
    ],
)
def test_the_baseline_flies_slow_rotors(vehicle: str, trial: str) -> None:
    flown = fly(load_vehicle(str(FILES / f"{vehicle}.toml")), trial, controller="geometric-se3")
    assert not flown.lost
    assert flown.swing_rad_s < 0.5


def test_the_hummingbird_has_the_numbers_of_the_tuning() -> None:
    found = scaled("lpv-mpc", TABLE, load_vehicle("hummingbird"))
    assert found["guidance"]["poles"] == [-7.0, -8.0]
    assert found["guidance"]["max_acceleration_m_s2"] == 14.0
    assert found["observer"] == {
        "acceleration_rad_s": 9.0, "moment_rad_s": 12.0, "max_acceleration_m_s2": 6.0, "max_moment_n_m": 0.3
    }  # fmt: skip
    assert found["plan"]["max_rate_rad_s"] == [10.0, 10.0, 6.0]
    assert (found["weights"]["position"], found["weights"]["rate"]) == (100.0, 0.015)


def test_a_number_in_the_profile_wins() -> None:
    heavy = load_vehicle(str(FILES / "heavy30.toml"))
    given = {**TABLE, "observer": {"max_moment_n_m": 0.5}}
    assert scaled("lpv-mpc", given, heavy)["observer"]["max_moment_n_m"] == 0.5
    assert load_profile("flight").replace("controllers.lpv-mpc.weights.rate", 0.02).of(heavy).value(
        "controllers.lpv-mpc.weights.rate"
    ) == pytest.approx(0.02)


def test_a_vehicle_too_heavy_for_its_rotors_is_refused() -> None:
    vehicle = load_vehicle("hummingbird")
    heavy = vehicle.replace("body.mass_kg", 0.96 * capability_of(vehicle).thrust * vehicle.body.mass_kg)
    with pytest.raises(SettingsError, match=r"the largest thrust is 1\.04 times the weight: at least 1\.05"):
        scaled("lpv-mpc", TABLE, heavy)
    assert np.isfinite(capability_of(heavy).turn_rad_s2).all()
    lighter = vehicle.replace("body.mass_kg", 0.935 * capability_of(vehicle).thrust * vehicle.body.mass_kg)
    assert 0.0 < scaled("lpv-mpc", TABLE, lighter)["guidance"]["max_acceleration_m_s2"] < 1.0
