"""The plant's GPS receiver: it measures at its rate, and reports after its delay."""

from collections import deque
from dataclasses import replace
from math import hypot

from colibri.common.compiled_rotations import earth_from_body
from colibri.common.earth.compiled_geodesy import geodetic_of
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import GpsFix
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.world import World
from colibri.plant.sensors.instrument import GaussMarkov, Measure, Rate, SensorSurroundings
from colibri.plant.vehicle.sensors import Gps


def switched_on(part: Gps, setting: SensorSurroundings, chance: Chance) -> Measure:
    """Measure position with white and correlated errors, velocity with white ones; report after the delay."""
    rate, delay_us = Rate(part.rate_hz), round(part.delay_s * 1e6)
    sideways, upward = part.horizontal_drift_m, part.vertical_drift_m
    drifts = tuple(GaussMarkov(deviation, part.drift_time_s, chance) for deviation in (sideways, sideways, upward))
    pending: deque[GpsFix] = deque()

    def fix(world: World) -> GpsFix:
        u, v, w, _, _, _, x, y, z = world.state[:9]
        east, north, up = [drift.at(world.time_us) for drift in drifts]
        measured_m = (
            x + east + part.horizontal_noise_m * next(chance),
            y + north + part.horizontal_noise_m * next(chance),
            z + up + part.vertical_noise_m * next(chance),
        )
        vx, vy, vz = earth_from_body(attitude_of(world.state), (u, v, w))
        noise_m_s = part.velocity_noise_m_s
        return GpsFix(
            time_us=world.time_us + delay_us,
            fix_type=part.fix_type,
            place=geodetic_of(measured_m, setting.origin),
            velocity_enu_m_s=(
                vx + noise_m_s * next(chance),
                vy + noise_m_s * next(chance),
                vz + noise_m_s * next(chance),
            ),
            horizontal_accuracy_m=hypot(part.horizontal_noise_m, part.horizontal_drift_m),
            vertical_accuracy_m=hypot(part.vertical_noise_m, part.vertical_drift_m),
            satellites=part.satellites,
        )

    def measure(world: World) -> GpsFix | None:
        if rate.is_due(world.time_us):
            pending.append(fix(world))
        return pending.popleft() if pending and pending[0].time_us <= world.time_us else None

    return measure


def moved(fix: GpsFix, error: Vector) -> GpsFix:
    return replace(fix, place=geodetic_of(error, fix.place))
