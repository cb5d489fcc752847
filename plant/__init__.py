"""The vehicle that flies: its description, its nonlinear dynamics, and the process that integrates them."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.plant.environment.weather import Gust, RecordedWind, Weather, Wind
    from colibri.plant.errors import PlantError
    from colibri.plant.physics.start import IntegrationError, Start
    from colibri.plant.physics.world import Physics, World, starting_world
    from colibri.plant.simulation.plant import Plant
    from colibri.plant.vehicle.description import Vehicle, VehicleError, load_vehicle, vehicle_names
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "colibri.plant.environment.weather": "Gust RecordedWind Weather Wind",
            "colibri.plant.errors": "PlantError",
            "colibri.plant.physics.start": "IntegrationError Start",
            "colibri.plant.physics.world": "Physics World starting_world",
            "colibri.plant.simulation.plant": "Plant",
            "colibri.plant.vehicle.description": "Vehicle VehicleError load_vehicle vehicle_names",
        },
    )

__all__ = [
    "Gust",
    "IntegrationError",
    "Physics",
    "Plant",
    "PlantError",
    "RecordedWind",
    "Start",
    "Vehicle",
    "VehicleError",
    "Weather",
    "Wind",
    "World",
    "load_vehicle",
    "starting_world",
    "vehicle_names",
]
