"""The simulated vehicle: its description, its nonlinear dynamics, and the process that integrates them."""

from typing import TYPE_CHECKING

from colibri.common.lazy import public

if TYPE_CHECKING:
    from colibri.plant.environment.weather import Gust as Gust
    from colibri.plant.environment.weather import RecordedWind as RecordedWind
    from colibri.plant.environment.weather import Weather as Weather
    from colibri.plant.environment.weather import Wind as Wind
    from colibri.plant.errors import PlantError as PlantError
    from colibri.plant.physics.start import IntegrationError as IntegrationError
    from colibri.plant.physics.start import Start as Start
    from colibri.plant.physics.world import Physics as Physics
    from colibri.plant.physics.world import World as World
    from colibri.plant.physics.world import starting_world as starting_world
    from colibri.plant.simulation.plant import Plant as Plant
    from colibri.plant.vehicle.description import Vehicle as Vehicle
    from colibri.plant.vehicle.description import VehicleError as VehicleError
    from colibri.plant.vehicle.description import load_vehicle as load_vehicle
    from colibri.plant.vehicle.description import vehicle_names as vehicle_names
else:
    __getattr__, __dir__ = public(__name__)
