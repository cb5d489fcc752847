"""Drag and wind against closed forms."""

from math import exp, tanh

import numpy as np
import pytest
from hypothesis import given, settings

from colibri.common.types import Vector
from colibri.plant.physics.start import Start
from colibri.plant.texts import wind
from tests.support.plant_flights import OFF, command, flight, hover, hummingbird, rpm, states
from tests.support.strategies import reals, vectors

VEHICLE = hummingbird("drag")
MASS_KG = VEHICLE.body.mass_kg
HOVER = VEHICLE.hover_speed
ROTOR_DRAG = 8.06428e-5


def test_a_level_fall_reaches_the_terminal_velocity() -> None:
    terminal = MASS_KG * 9.81 / 0.05
    end = flight(VEHICLE, Start(z=1000.0), OFF, 10.0)[-1]
    assert end.state[2] == pytest.approx(-terminal * (1.0 - exp(-10.0 * 9.81 / terminal)), rel=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_glide_fades_by_the_drag_of_airframe_and_rotors(axis: int) -> None:
    start = Start(z=9.0, vx=3.0 * (axis == 0), vy=3.0 * (axis == 1), rotors=rpm(VEHICLE, HOVER))
    end = flight(VEHICLE, start, hover(VEHICLE), 2.0)[-1]
    fade = exp(-2.0 * (0.025 + 4.0 * ROTOR_DRAG * HOVER) / MASS_KG)
    assert end.state[axis] == pytest.approx(3.0 * fade, rel=1e-9)


def test_a_spin_fades_by_the_drag_of_the_rotors() -> None:
    end = flight(VEHICLE, Start(z=9.0, r=5.0, rotors=rpm(VEHICLE, HOVER)), hover(VEHICLE), 2.0)[-1]
    assert end.state[5] == pytest.approx(5.0 * exp(-2.0 * 4.0 * ROTOR_DRAG * HOVER * 0.171**2 / 0.006), rel=1e-9)


def test_uneven_rotors_turn_a_glide() -> None:
    """The faster rotor on the left brakes the left side: the nose turns left."""
    left, right = 1.1 * HOVER, 0.9 * HOVER
    vehicle = hummingbird("drag")
    start = Start(z=9.0, vx=3.0)
    order = command(HOVER, right, HOVER, left, vehicle=vehicle)
    braked = flight(vehicle, start, order, 0.004)[-1].state[5]
    unbraked = flight(vehicle.without({"drag"}), start, order, 0.004)[-1].state[5]
    assert braked - unbraked == pytest.approx(0.004 * ROTOR_DRAG * (left - right) * 3.0 * 0.171 / 0.006, rel=0.01)


def test_the_wind_blows_from_where_it_is_said_to() -> None:
    assert wind("5@270").velocity_at(0.0) == pytest.approx((5.0, 0.0, 0.0), abs=1e-12)
    assert wind("5@0").velocity_at(0.0) == pytest.approx((0.0, -5.0, 0.0), abs=1e-12)
    assert wind("5@45").velocity_at(0.0) == pytest.approx((-5.0 / 2**0.5, -5.0 / 2**0.5, 0.0))
    assert wind(str(wind("3.7@123.4"))) == wind("3.7@123.4")


@settings(max_examples=25)
@given(vectors(5.0), vectors(5.0), reals(90.0), vectors(3.0))
def test_a_wind_is_a_moving_frame(air: Vector, velocity: Vector, tilt_deg: float, rate: Vector) -> None:
    p, q, r = rate
    vx, vy, vz = velocity
    start = Start(z=90.0, phi=tilt_deg, theta=0.5 * tilt_deg, vx=vx, vy=vy, vz=vz, p=p, q=q, r=r, rotors=4000.0)
    moving = start._replace(vx=vx - air[0], vy=vy - air[1], vz=vz - air[2])
    order = command(480.0, 500.0, 510.0, 495.0, vehicle=VEHICLE)
    blown, calm = (
        states(flight(VEHICLE, start, order, 0.5, wind=air))[-1],
        states(flight(VEHICLE, moving, order, 0.5))[-1],
    )
    assert blown[6:9] == pytest.approx(calm[6:9] + 0.5 * np.array(air), abs=1e-8)
    assert blown[9:13] == pytest.approx(calm[9:13], abs=1e-8)


def test_quadratic_drag_sets_the_terminal_velocity() -> None:
    vehicle = VEHICLE.replace("drag.linear_n_s_m", [0.0, 0.0, 0.0]).replace("drag.quadratic_n_s2_m2", [0.0, 0.0, 0.02])
    terminal = (MASS_KG * 9.81 / 0.02) ** 0.5
    end = flight(vehicle, Start(z=1000.0), OFF, 10.0)[-1]
    assert end.state[2] == pytest.approx(-terminal * tanh(9.81 * 10.0 / terminal), rel=1e-9)
