"""Commands that arrive late act late, to the microsecond, and the one before holds until then."""

from typing import Any

import pytest

from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, starting_world
from colibri.plant.simulation.plant import DelayedCommands, Plant
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird").without(["battery"])
FRAME_US = 8_000


def command(share: float, armed: bool = True) -> ActuatorCommand:
    return ActuatorCommand(0, (share, share, share, share), armed)


def test_the_last_that_has_arrived_is_followed() -> None:
    first, second, third = command(0.1), command(0.2), command(0.3)
    actuation = DelayedCommands(first)
    actuation.arrive(10, second)
    actuation.arrive(14, third)
    assert list(actuation.spans(0, 8)) == [(first, 8)]
    assert list(actuation.spans(8, 16)) == [(first, 2), (second, 4), (third, 2)]
    assert list(actuation.spans(16, 24)) == [(third, 8)]


def test_an_overtaken_command_is_never_followed() -> None:
    actuation = DelayedCommands(command(0.0))
    actuation.arrive(0, command(0.1))
    actuation.arrive(0, command(0.2))
    assert list(actuation.spans(0, 8)) == [(command(0.2), 8)]


def hovering(latency_us: int) -> Plant:
    world, physics = starting_world(Start(z=10.0, rotors=4740.0), VEHICLE), Physics(VEHICLE, "rk4")
    options: dict[str, Any] = {"seed": 0, "interval_us": FRAME_US, "latency_us": latency_us}
    return Plant(world, VEHICLE, physics, Feedback.STATE, DEFAULT_ORIGIN, **options)


def flown(latency_us: int, frames: int) -> list[float]:
    plant = hovering(latency_us)
    speeds = []
    for _ in range(frames):
        speeds.append(plant.world.rotor_speeds[0])
        plant.answer(command(0.9))
    return speeds


def test_latency_shifts_what_happens() -> None:
    at_once, late = flown(0, 30), flown(4_000, 31)
    assert late[1:] == pytest.approx(at_once, rel=1e-12)
    assert late[0] == late[1]


def test_a_plant_says_how_late_the_last_command_took_effect() -> None:
    for latency_us, said in ((0, [None, None, None]), (4_500, [None, None, 9_000])):
        plant = hovering(latency_us)
        delays = []
        for _ in said:
            delays.append(plant.measure()[1].delay_us)
            plant.answer(ActuatorCommand(plant.world.time_us, (0.5,) * 4, armed=True))
        assert delays == said
