"""The plant's GPS receiver: it measures at its rate, and reports after its delay."""

from collections import deque
from dataclasses import replace
from math import hypot

from colibri.common.earth.compiled_geodesy import geodetic_of
from colibri.common.earth.geodesy import Geodetic
from colibri.common.rotations import earth_from_body
from colibri.common.types import Vector
from colibri.mavlink.hil.faults import GPS
from colibri.mavlink.hil.sensors import GpsFix
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.equations import attitude_of
from colibri.plant.physics.world import World
from colibri.plant.sensors.errors import GaussMarkov
from colibri.plant.sensors.instrument import Instrument, Measure, Rate, Setting
from colibri.plant.vehicle.sensors import Gps


class GpsReceiver:
    """Delayed fixes: position with white and correlated errors, velocity with white ones."""

    def __init__(self, part: Gps, origin: Geodetic, chance: Chance) -> None:
        self._part = part
        self._origin = origin
        self._chance = chance
        self._delay_us = round(part.delay_s * 1e6)
        sideways, upward, time_s = part.horizontal_drift_m, part.vertical_drift_m, part.drift_time_s
        self._drifts = tuple(GaussMarkov(deviation, time_s, chance) for deviation in (sideways, sideways, upward))
        self._measured_us: int | None = None
        self._pending: deque[GpsFix] = deque()

    def measure(self, time_us: int, position_enu_m: Vector, velocity_enu_m_s: Vector) -> None:
        """Sample a fix now; it is delivered after the receiver's delay."""
        part, chance = self._part, self._chance
        if self._measured_us is not None:
            for drift in self._drifts:
                drift.after((time_us - self._measured_us) * 1e-6)
        self._measured_us = time_us
        east, north, up = (drift.value for drift in self._drifts)
        x, y, z = position_enu_m
        measured_m = (
            x + east + part.horizontal_noise_m * next(chance),
            y + north + part.horizontal_noise_m * next(chance),
            z + up + part.vertical_noise_m * next(chance),
        )
        vx, vy, vz = velocity_enu_m_s
        noise_m_s = part.velocity_noise_m_s
        fix = GpsFix(
            time_us=time_us + self._delay_us,
            fix_type=part.fix_type,
            place=geodetic_of(measured_m, self._origin),
            velocity_enu_m_s=(
                vx + noise_m_s * next(chance),
                vy + noise_m_s * next(chance),
                vz + noise_m_s * next(chance),
            ),
            horizontal_accuracy_m=hypot(part.horizontal_noise_m, part.horizontal_drift_m),
            vertical_accuracy_m=hypot(part.vertical_noise_m, part.vertical_drift_m),
            satellites=part.satellites,
        )
        self._pending.append(fix)

    def report(self, time_us: int) -> GpsFix | None:
        if self._pending and self._pending[0].time_us <= time_us:
            return self._pending.popleft()
        return None


def _switched_on(part: Gps, setting: Setting, chance: Chance) -> Measure:
    receiver, rate = GpsReceiver(part, setting.origin, chance), Rate(part.rate_hz)
    seen: list[World] = []

    def catch_up() -> None:
        """Measure the world seen at the previous frame: the fix is due only after the receiver's delay."""
        while seen:
            world = seen.pop()
            u, v, w, _, _, _, x, y, z = world.state[:9]
            receiver.measure(world.time_us, (x, y, z), earth_from_body(attitude_of(world.state), (u, v, w)))

    def measure(world: World) -> GpsFix | None:
        catch_up()
        if rate.is_due(world.time_us):
            seen.append(world)
            if part.delay_s == 0.0:
                catch_up()
        return receiver.report(world.time_us)

    setting.ahead.append(catch_up)
    return measure


def _moved(fix: GpsFix, error: Vector) -> GpsFix:
    """Displace a fix by metres east, north and up; its stated accuracy stays."""
    return replace(fix, place=geodetic_of(error, fix.place))


ROW = Instrument(
    part="gps",
    field="gps",
    group=0,
    unit=GPS,
    switched_on=_switched_on,
    add=_moved,
    at=lambda fix, now_us: replace(fix, time_us=now_us),
)
