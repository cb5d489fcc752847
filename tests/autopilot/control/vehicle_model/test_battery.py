"""The autopilot's account of the battery against the plant's."""

import msgspec
import numpy as np
import pytest

from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")
MODEL = BatteryModel(VEHICLE)


@pytest.mark.parametrize("part", [0.5, 0.7, 1.0])
def test_charge_and_top_speed_are_the_plants(part: float) -> None:
    """Half a minute at one command: the same charge taken, and rotors no faster than the model says they can be."""
    physics = Physics(VEHICLE, "rk4")
    world = starting_world(Start(z=100.0, rotors=4740.0), VEHICLE)
    charge_ah = 0.0
    for _ in range(3000):
        speeds = np.array(world.rotor_speeds) / VEHICLE.rotors.max_speed
        charge_ah = MODEL.charge_after(charge_ah, speeds, 0.01)
        world = physics.step(world, ActuatorCommand(world.time_us, (part, part, part, part), armed=True), 10_000)
    assert charge_ah == pytest.approx(world.charge_used_ah, rel=0.01)
    reached = world.rotor_speeds[0] / VEHICLE.rotors.max_speed
    assert reached == pytest.approx(min(part, MODEL.max_common_speed(charge_ah)), rel=2e-3)


def test_without_a_battery_nothing_tires() -> None:
    endless = BatteryModel(msgspec.structs.replace(VEHICLE, battery=None))
    assert endless.charge_after(0.0, np.ones(4), 3600.0) == 0.0
    assert endless.max_common_speed(100.0) == endless.max_speed_now(100.0, np.ones(4)) == 1.0


def test_an_empty_battery_stays_empty() -> None:
    assert VEHICLE.battery is not None
    capacity_ah = VEHICLE.battery.capacity_ah
    max_speed = MODEL.max_common_speed
    assert 0.0 < max_speed(2.0 * capacity_ah) == max_speed(capacity_ah) < max_speed(0.0) < 1.0


def test_a_rotor_alone_can_turn_faster_than_all_together() -> None:
    together = MODEL.max_common_speed(0.5)
    assert MODEL.max_speed_now(0.5, np.full(4, together)) == pytest.approx(together)
    assert together < MODEL.max_speed_now(0.5, np.full(4, 0.6)) < 1.0
