"""Drag learned from the acceleration that thrust and weight do not explain."""

import numpy as np
import pytest

from colibri.autopilot.control.vehicle_model.airframe import Airframe, drag_force
from colibri.autopilot.control.vehicle_model.drag import LEARNED, learn_drag, with_learned
from colibri.common.types import Vector

GUESSED = Airframe(0.032, 9.81, 0.008, 0.006, 0.004)
UP = np.array([0.36, -0.48, 0.8])


def learned(true: Airframe, speed_m_s: float, wind: Vector = (0.0, 0.0, 0.0)) -> Airframe:
    """Learn from 20 s of motion in three directions, held at one attitude."""
    state = np.zeros(LEARNED)
    for t in np.arange(0.0, 20.0, 0.008):
        velocity = speed_m_s * np.array([np.sin(t), np.cos(2.0 * t), np.sin(3.0 * t)])
        unexplained = np.array(drag_force(true, velocity - wind, UP, 0.31)) / true.mass_kg
        learn_drag(drag_force(GUESSED, velocity, UP, 0.31), unexplained, UP, GUESSED, 0.008, state)
    return with_learned(GUESSED, GUESSED.mass_kg, state)


@pytest.mark.parametrize("wind", [(0.0, 0.0, 0.0), (5.0, -3.0, 1.0)])
def test_drag_is_found_in_calm_air_and_in_wind(wind: Vector) -> None:
    true = Airframe(0.032, 9.81, 1.5 * 0.008, 0.7 * 0.006, 1.5 * 0.004)
    assert learned(true, 4.0, wind) == pytest.approx(true, rel=0.01)


def test_slow_motion_teaches_nothing() -> None:
    assert learned(GUESSED._replace(drag_xy=0.016), 0.5) == GUESSED


def test_a_factor_stays_within_its_bounds() -> None:
    found = learned(Airframe(0.032, 9.81, 0.08, 0.0, 0.04), 4.0)
    assert found == pytest.approx((0.032, 9.81, 2.5 * 0.008, 0.4 * 0.006, 2.5 * 0.004))
