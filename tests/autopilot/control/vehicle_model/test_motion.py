"""The autopilot's equations of motion are the plant's, but for what it cannot know: wind and ground."""

import numpy as np
import pytest

from colibri.autopilot.control.vehicle_model import motion
from colibri.autopilot.control.vehicle_model.battery import open_voltage_v
from colibri.common.jit import packed
from colibri.common.rotations import earth_from_body, normalized
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.world import Physics, World, state_frame
from colibri.plant.vehicle.description import load_vehicle

USED_AH = 0.4
NONE = np.zeros(6)


@pytest.mark.parametrize("without", [(), ("battery",), ("drag", "rotor-lag")])
def test_carried_forward_a_state_is_the_plants(without: tuple[str, ...]) -> None:
    vehicle = load_vehicle("hummingbird").without(["ground", *without])
    rng = np.random.default_rng(1)
    a, b, c, d = rng.normal(size=4).tolist()
    attitude = normalized((a, b, c, d))
    velocity, rate = (4.0, -2.0, 1.0), (1.0, -2.0, 0.5)
    hover = vehicle.hover_speed
    commands = hover * rng.uniform(0.97, 1.0, (6, 4))  # rotors that slow down throughout: a lag has no corner then
    durations_us = [5_000, 8_000, 8_000, 8_000, 8_000, 3_000]
    world = World(0, (*velocity, *rate, 1.0, 2.0, 50.0, *attitude), (hover, hover, hover, hover), USED_AH)
    physics = Physics(vehicle, "adaptive")
    for speeds, duration_us in zip(commands, durations_us, strict=True):
        e, f, g, h = (speeds / vehicle.rotors.max_speed).tolist()
        world = physics.step(world, ActuatorCommand(0, (e, f, g, h), armed=True), duration_us)
    voltage_v = open_voltage_v(vehicle.battery, USED_AH) if vehicle.battery else 1.0
    x = np.array([1.0, 2.0, 50.0, *earth_from_body(attitude, velocity), *attitude, *rate, *[hover] * 4])
    model = packed(motion.motion_model(vehicle))
    after = motion.carry(x, 1e-6 * np.array(durations_us), commands, NONE, voltage_v, model)
    frame = state_frame(world)
    there = [*frame.position_enu_m, *frame.velocity_enu_m_s, *frame.attitude, *frame.rate_flu_rad_s]
    assert after[: motion.ROTORS.start] == pytest.approx(there, abs=1e-6)
    assert after[motion.ROTORS] == pytest.approx(world.rotor_speeds, rel=1e-6)


def test_a_disturbance_carries_it_along() -> None:
    vehicle = load_vehicle("hummingbird").without(["drag"])
    hover = np.full((1, 4), vehicle.hover_speed)
    x = np.array([*[0.0] * 6, 1.0, *[0.0] * 6, *hover[0]])
    disturbance = np.array([0.5, 0.0, -1.0, 0.0, 0.0, 2.0])
    after = motion.carry(x, np.array([0.04]), hover, disturbance, 12.6, packed(motion.motion_model(vehicle)))
    assert after[motion.VELOCITY] == pytest.approx(0.04 * disturbance[:3], abs=1e-12)
    assert after[motion.POSITION] == pytest.approx(0.5 * 0.04**2 * disturbance[:3], abs=1e-12)
    assert after[motion.RATE] == pytest.approx([0.0, 0.0, 0.08], abs=1e-12)
