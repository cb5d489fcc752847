"""A frame that was integrated before its command came is the same frame."""

from collections.abc import Sequence

import pytest

from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.hil.world_changes import PayloadChange, WorldChange
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import World
from colibri.plant.simulation.plant import PlantBuilder
from colibri.plant.spec import PlantSpec
from colibri.plant.vehicle.description import load_vehicle

VEHICLE = load_vehicle("hummingbird")


def flown(shares: Sequence[float], *, foresees: bool, latency: float = 0.0, frame_us: int = 4_000) -> list[World]:
    start = {Feedback.STATE: Start(z=10.0, rotors=4740.0)}
    plant = PlantBuilder(PlantSpec(latency=latency), VEHICLE, start).build(Feedback.STATE, frame_us)
    worlds = []
    for number, share in enumerate(shares):
        if foresees:
            plant.foresee()
        asked: list[Fault | WorldChange] = [PayloadChange(0.1)] if number == 9 else []
        plant.answer(ActuatorCommand(plant.world.time_us, (share,) * 4, armed=number != 12), asked)
        worlds.append(plant.world)
    return worlds


@pytest.mark.parametrize("latency", [0.0, 3.0])
@pytest.mark.parametrize(
    "shares", [[0.5] * 16, [0.4, 0.4, 0.6, 0.6] * 4, [0.5, 0.51, 0.52, 0.53] * 4, [0.4, 0.4, 0.4, 0.6] * 4]
)
def test_a_foreseen_frame_is_the_same(shares: list[float], latency: float) -> None:
    assert flown(shares, foresees=True, latency=latency) == flown(shares, foresees=False, latency=latency)
