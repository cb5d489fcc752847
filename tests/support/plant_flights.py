"""Vehicles with some of their parts, and flights of them at a constant command."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from colibri.common.types import Array, Vector
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.plant.environment.turbulence import CALM
from colibri.plant.environment.weather import RecordedWind, Weather
from colibri.plant.physics.integrators import Integrator
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import Physics, World, starting_world
from colibri.plant.spec import PARTS
from colibri.plant.vehicle.description import Vehicle, load_vehicle

OFF = ActuatorCommand(0, (0.0, 0.0, 0.0, 0.0), armed=False)
FRAME_US = 4000


def hummingbird(*parts: str) -> Vehicle:
    return load_vehicle("hummingbird").without(set(PARTS) - set(parts))


def command(*speeds: float, vehicle: Vehicle) -> ActuatorCommand:
    c1, c2, c3, c4 = (speed / vehicle.rotors.max_speed for speed in (speeds if len(speeds) == 4 else speeds * 4))
    return ActuatorCommand(0, (c1, c2, c3, c4), armed=True)


def hover(vehicle: Vehicle, share_of_weight: float = 1.0) -> ActuatorCommand:
    return command(vehicle.hover_speed * share_of_weight**0.5, vehicle=vehicle)


def rpm(vehicle: Vehicle, speed: float) -> float:
    return speed / vehicle.speed_from_rpm(1.0)


def flight(
    vehicle: Vehicle,
    start: Start | World,
    order: ActuatorCommand,
    duration_s: float,
    *,
    integrator: Integrator = "rk4",
    wind: Vector = CALM,
    frame_us: int = FRAME_US,
) -> list[World]:
    physics = Physics(vehicle, integrator, blowing(wind))
    worlds = [start if isinstance(start, World) else starting_world(start, vehicle, blowing(wind))]
    while worlds[-1].time_us < duration_s * 1e6:
        worlds.append(physics.step(worlds[-1], order, frame_us))
    return worlds


def blowing(velocity_enu_m_s: Vector) -> Weather:
    return Weather(RecordedWind(Path("always.csv"), (0.0,), (velocity_enu_m_s,)))


def states(worlds: Sequence[World]) -> Array:
    return np.array([world.state for world in worlds])


def speeds(worlds: Sequence[World]) -> Array:
    return np.array([world.rotor_speeds for world in worlds])
