"""Frames flown in one call are those flown one by one, and so is the truth that is logged of them."""

from typing import Any

import numpy as np
import pytest

from colibri.mavlink.hil.faults import MOTOR, OFF, Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.ulog.log import MemoryLog
from colibri.plant.environment.weather import Wind
from colibri.plant.events import Payload
from colibri.plant.physics.start import IntegrationError, Start
from colibri.plant.process.reports import TruthLog
from colibri.plant.simulation.plant import Plant, PlantBuilder
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle

FRAME_US, FRAMES = 4_000, 15


def plant_of(vehicle: str, *, p: float = 20.0, **options: Any) -> Plant:
    start = {Feedback.STATE: Start(z=10.0, rotors=3000.0, p=p, vx=2.0)}
    return PlantBuilder(PlantSpec(**options), load_vehicle(vehicle), start).build(Feedback.STATE, FRAME_US)


def held(plant: Plant) -> ActuatorCommand:
    count = len(plant.world.rotor_speeds)
    return ActuatorCommand(plant.world.time_us, tuple(0.4 + 0.01 * rotor for rotor in range(count)), armed=True)


def logged(plant: Plant, vehicle: str, at_once: int) -> bytes:
    """Fly 15 frames, and return the file of the truth."""
    log = MemoryLog(for_viewers=True)
    truth = TruthLog(log, load_vehicle(vehicle))
    truth.write_world(plant.world)
    while plant.world.time_us < FRAMES * FRAME_US:
        plant.answer(held(plant), (), plant.world.time_us + at_once * FRAME_US)
        if at_once == 1:
            truth.write_world(plant.world)
        else:
            truth.write(plant.flown, plant.world.time_us)
    return b"".join(log.encoded())


@pytest.mark.parametrize("vehicle", ["hummingbird", "firefly", "x8"])
@pytest.mark.parametrize("options", [{}, {"integrator": "adaptive"}, {"wind": Wind(5.0, 30.0)}])
def test_frames_at_once_are_the_same(vehicle: str, options: dict[str, Any]) -> None:
    singly, together = plant_of(vehicle, **options), plant_of(vehicle, **options)
    assert logged(singly, vehicle, 1) == logged(together, vehicle, 5)
    assert singly.world == together.world
    assert together.world.time_us == FRAMES * FRAME_US


def test_an_event_ends_them() -> None:
    plant = plant_of("hummingbird", events=(Payload(t=0.011, kg=0.1),))
    plant.answer(held(plant), (), FRAMES * FRAME_US)
    assert plant.flown[:, 0].tolist() == [4_000.0, 8_000.0, 12_000.0]


@pytest.mark.parametrize(("options", "asked"), [({}, [Fault(MOTOR, OFF, 1)]), ({"turbulence": "light"}, [])])
def test_only_one_is_flown_before_news_or_a_change_of_the_air(options: dict[str, Any], asked: list[Fault]) -> None:
    plant = plant_of("hummingbird", **options)
    plant.answer(held(plant), asked, FRAMES * FRAME_US)
    assert plant.world.time_us == FRAME_US


def test_those_before_a_state_that_is_not_finite_are_flown() -> None:
    plant = plant_of("hummingbird", p=3000.0)
    plant.answer(held(plant), (), FRAMES * FRAME_US)
    flown = len(plant.flown)
    assert 0 < flown < FRAMES
    assert np.isfinite(plant.world.state).all()
    with pytest.raises(IntegrationError, match=rf"at t = 0\.{flown * 4:03d} s"):
        plant.answer(held(plant), (), FRAMES * FRAME_US)
