"""The interface of a sensor: the true world in, its output at that frame out."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.world import Physics, World

Measure: TypeAlias = Callable[[World], Any]  # the world at each frame -> a sensor's output; None without a new one

_ROUNDING = 1e-9


def vector_sum(value: Vector, error: Vector) -> Vector:
    return (value[0] + error[0], value[1] + error[1], value[2] + error[2])


class SensorSurroundings(NamedTuple):
    physics: Physics
    origin: Geodetic
    interval_s: float


class Instrument(NamedTuple):
    """A sensor that a vehicle may have."""

    part: str  # its table in the vehicle file
    field: str  # of `SensorFrame`
    group: int  # bit of `Updated` if the field keeps its last output; 0 if it is None between outputs
    unit: int  # FAILURE_UNIT
    switched_on: Callable[[Any, SensorSurroundings, Chance], Measure]
    add: Callable[[Any, Vector], Any] = vector_sum  # (value, error of a fault) -> erroneous value
    at: Callable[[Any, int], Any] = lambda value, _: value  # (value, time in µs) -> value with that time stamp


class Rate:
    """Samples at the first frame at or after each multiple of its interval."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_mhz = rate_hz * 1e-6
        self._samples = -1

    def is_due(self, time_us: int) -> bool:
        """Return whether there is a sample; call it once a frame."""
        samples = int(time_us * self._rate_mhz + _ROUNDING)
        due = samples > self._samples
        self._samples = samples
        return due
