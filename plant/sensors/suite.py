"""All sensors of the plant; measurements depend on seed, simulated time and truth alone."""

from typing import Any

from msgspec.structs import astuple

from colibri.common.earth.atmosphere import temperature_c
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.environment.random_streams import RandomStream, seeds, streams
from colibri.plant.physics.world import Physics, World
from colibri.plant.sensors.faults import SensorFaults
from colibri.plant.sensors.instrument import SensorSurroundings
from colibri.plant.sensors.table import ROWS, is_fitted
from colibri.plant.vehicle.description import Vehicle
from colibri.plant.vehicle.sensors import Sensors

_PLACE = {field: place for place, field in enumerate(SensorFrame.__struct_fields__)}
_TIME, _UPDATED, _TEMPERATURE = _PLACE["time_us"], _PLACE["updated"], _PLACE["temperature_c"]


def served_by(vehicle: Vehicle) -> list[Feedback]:
    return [Feedback.STATE] if vehicle.sensors is None else list(Feedback)


class SensorSuite:
    """All sensors of one vehicle; frames pass through `faults`, if given."""

    def __init__(
        self,
        parts: Sensors,
        physics: Physics,
        origin: Geodetic,
        *,
        seed: int,
        interval_us: int,
        faults: SensorFaults | None = None,
    ) -> None:
        self._faults, self._origin = faults, origin
        setting = SensorSurroundings(physics, origin, interval_us * 1e-6)
        self._chances = chances = streams(seed, RandomStream.SENSORS, len(ROWS))
        self._instruments = [
            (_PLACE[row.field], row.group, row.switched_on(getattr(parts, row.part), setting, chance))
            for row, chance in zip(ROWS, chances, strict=True)
            if is_fitted(row, parts)
        ]
        nothing = (0.0, 0.0, 0.0)
        first = SensorFrame(0, 0, nothing, nothing, nothing, pressure_pa=0.0, temperature_c=0.0)
        self._reported: list[Any] = [*astuple(first)]
        self._frame: SensorFrame | None = None

    def reseed(self, seed: int) -> None:
        """Draw the noise from now on by another seed; biases stay."""
        for chance, child in zip(self._chances, seeds(seed, RandomStream.SENSORS, len(ROWS)), strict=True):
            chance.begin(child)

    def measure(self, world: World) -> SensorFrame:
        """Return the frame of `world`: the next one, or the previous one again."""
        if self._frame is None or self._frame.time_us != world.time_us:
            frame = self._measured(world)
            self._frame = frame if self._faults is None else self._faults.through(frame)
        return self._frame

    def _measured(self, world: World) -> SensorFrame:
        reported, updated = self._reported, 0
        for place, group, measure in self._instruments:
            value = measure(world)
            if value is not None:
                updated |= group
                reported[place] = value
            elif not group:
                reported[place] = None
        reported[_TIME], reported[_UPDATED] = world.time_us, updated
        reported[_TEMPERATURE] = temperature_c(self._origin.altitude_m + world.state[8])
        return SensorFrame(*reported)
