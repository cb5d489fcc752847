"""The plant's magnetometer: Earth's field in body axes, hard iron, noise."""

from colibri.common.compiled_rotations import earth_from_body
from colibri.common.earth.magnetic_field import field_enu_gauss
from colibri.common.types import Vector
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.world import World
from colibri.plant.sensors.instrument import Measure, Rate, SensorSurroundings
from colibri.plant.vehicle.sensors import Magnetometer


def switched_on(part: Magnetometer, setting: SensorSurroundings, chance: Chance) -> Measure:
    earth_gauss, rate, noise = field_enu_gauss(setting.origin), Rate(part.rate_hz), part.noise_gauss
    own = part.hard_iron_gauss
    iron = (own * next(chance), own * next(chance), own * next(chance))

    def measure(world: World) -> Vector | None:
        if not rate.is_due(world.time_us):
            return None
        qw, qx, qy, qz = attitude_of(world.state)
        x, y, z = earth_from_body((qw, -qx, -qy, -qz), earth_gauss)
        return (
            x + iron[0] + noise * next(chance),
            y + iron[1] + noise * next(chance),
            z + iron[2] + noise * next(chance),
        )

    return measure
