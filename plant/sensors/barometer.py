"""The plant's barometer: standard atmosphere, slow drift, noise."""

from colibri.common.earth.atmosphere import pressure_pa
from colibri.common.types import Vector
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.world import World
from colibri.plant.sensors.instrument import GaussMarkov, Measure, Rate, SensorSurroundings
from colibri.plant.vehicle.sensors import Barometer


def switched_on(part: Barometer, setting: SensorSurroundings, chance: Chance) -> Measure:
    drift, rate = GaussMarkov(part.drift_pa, part.drift_time_s, chance), Rate(part.rate_hz)
    ground_m = setting.origin.altitude_m

    def measure(world: World) -> float | None:
        if not rate.is_due(world.time_us):
            return None
        drift_pa = drift.at(world.time_us)
        return pressure_pa(ground_m + world.state[8]) + drift_pa + part.noise_pa * next(chance)

    return measure


def shifted(pressure: float, error: Vector) -> float:
    return pressure + error[0]
