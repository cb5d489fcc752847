"""The battery: sag, charge, top speed, and what an empty one gives."""

from math import isnan

import msgspec
import numpy as np
import pytest

from colibri.plant.physics.integrators import Integrator
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import starting_world
from colibri.plant.vehicle.description import Battery, Vehicle
from tests.support.plant_flights import OFF, command, flight, hover, hummingbird, rpm, speeds

VEHICLE = hummingbird("battery", "rotor-lag")
FULL_V, EMPTY_V, OHM, AH, EFFICIENCY = 12.6, 9.0, 0.03, 2.1, 0.75
TOP = VEHICLE.rotors.max_speed


def power_w(vehicle: Vehicle, turned: np.ndarray) -> np.ndarray:
    power: np.ndarray = vehicle.rotors.torque_coefficient * (turned**3).sum(axis=-1) / EFFICIENCY
    return power


def with_battery(**changes: float) -> Vehicle:
    assert VEHICLE.battery is not None
    battery: Battery = msgspec.structs.replace(VEHICLE.battery, **changes)
    return msgspec.structs.replace(VEHICLE, battery=battery)


def test_the_voltage_sags_by_ohms_law() -> None:
    hovering = Start(z=50.0, rotors=rpm(VEHICLE, VEHICLE.hover_speed))
    world = flight(VEHICLE, hovering, hover(VEHICLE), 0.5)[-1]
    current_a = power_w(VEHICLE, speeds([world]))[0] / world.voltage_v
    open_v = FULL_V + (EMPTY_V - FULL_V) * world.charge_used_ah / AH
    assert world.voltage_v == pytest.approx(open_v - OHM * current_a, rel=1e-12)
    assert 0.3 < open_v - world.voltage_v < 0.6
    assert flight(VEHICLE, Start(z=50.0), OFF, 0.5)[-1].voltage_v == FULL_V


def test_the_charge_is_the_integral_of_the_current() -> None:
    worlds = flight(VEHICLE, Start(z=500.0), hover(VEHICLE, 1.5), 5.0)[1:]
    voltage_v = np.array([world.voltage_v for world in worlds])
    used_ah = np.array([world.charge_used_ah for world in worlds])
    current_a = power_w(VEHICLE, speeds(worlds)) / voltage_v
    assert used_ah[-1] - used_ah[100] == pytest.approx(np.trapezoid(current_a[100:], dx=0.004) / 3600.0, rel=1e-6)


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
@pytest.mark.parametrize("lag", [True, False])
def test_the_top_speed_is_proportional_to_the_voltage(lag: bool, integrator: Integrator) -> None:
    vehicle = VEHICLE if lag else VEHICLE.without({"rotor-lag"})
    world = flight(vehicle, Start(z=50.0), command(TOP, vehicle=vehicle), 0.4, integrator=integrator)[-1]
    assert world.rotor_speeds == pytest.approx([TOP * world.voltage_v / FULL_V] * 4, rel=1e-3 if lag else 1e-4)
    assert max(world.rotor_speeds) < 0.95 * TOP


def test_an_empty_battery_gives_what_its_voltage_allows() -> None:
    empty = starting_world(Start(z=500.0), VEHICLE)._replace(charge_used_ah=3.0 * AH)
    world = flight(VEHICLE, empty, command(TOP, vehicle=VEHICLE), 1.0)[-1]
    assert world.voltage_v < EMPTY_V
    assert max(world.rotor_speeds) == pytest.approx(TOP * world.voltage_v / FULL_V, rel=1e-3)
    assert flight(VEHICLE, empty, OFF, 0.1)[-1].voltage_v == EMPTY_V


@pytest.mark.parametrize("lag", [True, False])
@pytest.mark.parametrize("changes", [{"resistance_ohm": 50.0}, {"capacity_ah": 1e-6}, {"resistance_ohm": 0.0}])
def test_the_worst_battery_is_still_numbers(changes: dict[str, float], lag: bool) -> None:
    vehicle = with_battery(**changes) if lag else with_battery(**changes).without({"rotor-lag"})
    worlds = flight(vehicle, Start(z=50.0, rotors=8000.0), command(TOP, vehicle=vehicle), 0.5)
    assert np.isfinite([(*world.state, *world.rotor_speeds, world.charge_used_ah) for world in worlds]).all()
    assert all(world.voltage_v >= 0.5 * EMPTY_V for world in worlds[1:])


def test_without_a_battery_there_is_no_voltage_and_no_limit() -> None:
    vehicle = hummingbird("rotor-lag")
    world = flight(vehicle, Start(z=50.0), command(TOP, vehicle=vehicle), 0.5)[-1]
    assert isnan(world.voltage_v)
    assert world.charge_used_ah == 0.0
    assert world.rotor_speeds == pytest.approx([TOP] * 4)
