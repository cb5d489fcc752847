"""The plant's rangefinder: distance to the nearest point of flat ground in its beam."""

from math import hypot, inf

from colibri.common.kernels import acos, cos
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import Distance
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.world import World
from colibri.plant.sensors.instrument import Measure, Rate, SensorSurroundings
from colibri.plant.vehicle.sensors import Rangefinder

_FLATTEST_COSINE = 1e-3


def switched_on(part: Rangefinder, _setting: SensorSurroundings, chance: Chance) -> Measure:
    rate, half_beam_rad = Rate(part.rate_hz), 0.5 * part.field_of_view_rad

    def measure(world: World) -> Distance | None:
        if not rate.is_due(world.time_us):
            return None
        _, qx, qy, _ = attitude_of(world.state)
        tilt_rad = acos(max(-1.0, min(1.0, 1.0 - 2.0 * (qx * qx + qy * qy))))
        along = cos(max(tilt_rad - half_beam_rad, 0.0))
        height_m, error = world.state[8] + part.height_m, next(chance)
        distance_m = inf
        if along > _FLATTEST_COSINE:
            exact_m = height_m / along
            distance_m = exact_m + hypot(part.noise_m, part.noise_part * exact_m) * error
        if not part.min_m <= distance_m <= part.max_m:
            distance_m = inf
        return Distance(distance_m, part.min_m, part.max_m, part.field_of_view_rad)

    return measure


def shifted(reported: Distance, error: Vector) -> Distance:
    return reported._replace(distance_m=max(0.0, reported.distance_m + error[0]))
