"""The plant's accelerometer and gyroscope, sampled at every frame."""

from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.world import World
from colibri.plant.sensors.instrument import Measure, SensorSurroundings, Triad
from colibri.plant.vehicle.sensors import Accelerometer, Gyroscope


def accelerometer(part: Accelerometer, setting: SensorSurroundings, chance: Chance) -> Measure:
    walk, turn_on = part.bias_walk_m_s3_rthz, part.turn_on_bias_m_s2
    errors = Triad(part.noise_density_m_s2_rthz, walk, turn_on, part.range_m_s2, setting.interval_s, chance)
    specific_force = setting.physics.specific_force
    return lambda world: errors.measure(specific_force(world))


def gyroscope(part: Gyroscope, setting: SensorSurroundings, chance: Chance) -> Measure:
    walk, turn_on = part.bias_walk_rad_s2_rthz, part.turn_on_bias_rad_s
    errors = Triad(part.noise_density_rad_s_rthz, walk, turn_on, part.range_rad_s, setting.interval_s, chance)

    def measure(world: World) -> tuple[float, float, float]:
        p, q, r = world.state[3:6]
        return errors.measure((p, q, r))

    return measure
