"""The mass that is followed, of a body that feels its thrust and a wind."""

import numpy as np
import pytest

from colibri.autopilot.control.vehicle_model.mass import MassModel, MassSettings, follow_mass, mass_model
from colibri.common.jit import packed
from colibri.common.rotations import quaternion_from_euler, rotation_matrix
from colibri.plant.vehicle.description import load_vehicle

INTERVAL_S = 0.008
SETTINGS = MassSettings(rate_1_s=0.3, min_ratio=0.6, max_ratio=1.6)
MODEL = mass_model(SETTINGS, load_vehicle("hummingbird"), INTERVAL_S)
NOMINAL_KG = MODEL.nominal_kg
UP = np.array(rotation_matrix(quaternion_from_euler(0.4, -0.3, 1.0)))[:, 2].copy()


def followed(true_kg: float, thrust_n: float, seconds: float, model: MassModel = MODEL) -> float:
    """Follow the mass of a body whose disturbance is observed without a lag."""
    mass_kg = NOMINAL_KG
    for _ in range(round(seconds / INTERVAL_S)):
        mass_kg = follow_mass(mass_kg, thrust_n * (1.0 / true_kg - 1.0 / mass_kg) * UP, UP, thrust_n, packed(model)[0])
    return mass_kg


@pytest.mark.parametrize("thrust_n", [5.0, 14.0])
@pytest.mark.parametrize("ratio", [0.8, 1.2])
def test_the_specific_thrust_follows_as_a_lag_at_any_thrust(ratio: float, thrust_n: float) -> None:
    after_s = 1.0 / SETTINGS.rate_1_s
    specific = NOMINAL_KG / followed(ratio * NOMINAL_KG, thrust_n, after_s)
    assert (specific - 1.0) / (1.0 / ratio - 1.0) == pytest.approx(1.0 - np.exp(-1.0), abs=1e-3)
    assert followed(ratio * NOMINAL_KG, thrust_n, 10.0 * after_s) == pytest.approx(ratio * NOMINAL_KG, rel=1e-4)


def test_what_the_mass_explains_is_taken_out_of_the_disturbance() -> None:
    disturbance = np.array([0.5, -1.0, 2.0])
    left = disturbance.copy()
    mass_kg = follow_mass(NOMINAL_KG, left, UP, 9.0, packed(MODEL)[0])
    assert mass_kg < NOMINAL_KG
    assert left + 9.0 / mass_kg * UP == pytest.approx(disturbance + 9.0 / NOMINAL_KG * UP, abs=1e-12)


def test_what_acts_across_the_thrust_is_no_mass() -> None:
    across = np.cross(UP, [1.0, 0.0, 0.0])
    assert follow_mass(NOMINAL_KG, 3.0 * across, UP, 7.0, packed(MODEL)[0]) == pytest.approx(NOMINAL_KG, rel=1e-12)


def test_the_mass_stays_within_its_bounds() -> None:
    assert followed(0.3 * NOMINAL_KG, 7.0, 60.0) == pytest.approx(SETTINGS.min_ratio * NOMINAL_KG)
    assert followed(3.0 * NOMINAL_KG, 7.0, 60.0) == pytest.approx(SETTINGS.max_ratio * NOMINAL_KG)


def test_without_a_rate_the_nominal_mass_is_kept() -> None:
    off, disturbance = MODEL._replace(rate_1_s=0.0), np.array([0.0, 0.0, -2.0])
    assert follow_mass(NOMINAL_KG, disturbance, UP, 7.0, packed(off)[0]) == NOMINAL_KG
    assert disturbance.tolist() == [0.0, 0.0, -2.0]
    assert follow_mass(1.2 * NOMINAL_KG, disturbance, UP, 7.0, packed(off)[0]) == NOMINAL_KG
