"""The interface of a sensor: the true world in, its output at that frame out; and what faults do to that."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias, TypeVar

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.plant.environment.random_streams import Chance
from colibri.plant.physics.world import Physics, World

T = TypeVar("T")
Measure: TypeAlias = Callable[[World], Any]
"""The world at a frame, each the next one -> a sensor's output; None where that is nothing new."""

_ROUNDING = 1e-9


def as_it_is(value: T, _now_us: int) -> T:
    """Return a value that has no time of its own."""
    return value


def vector_sum(value: Vector, error: Vector) -> Vector:
    """Return a vector with an error."""
    return (value[0] + error[0], value[1] + error[1], value[2] + error[2])


class Setting(NamedTuple):
    """Where the sensors of one vehicle are.

    Attributes:
        ahead: Where each puts what it can do before it measures, whatever the world will be; it need not be done.
    """

    physics: Physics
    origin: Geodetic
    interval_s: float
    ahead: list[Callable[[], None]]


class Instrument(NamedTuple):
    """A sensor that a vehicle may have.

    Attributes:
        part: Its table in the vehicle file's sensors; a vehicle without it has no such sensor.
        field: Of `SensorFrame`.
        group: Of `Updated`: its field then holds the last output; 0 where that is None between two values.
        switched_on: (table, setting, standard normal numbers of its own) -> its measure.
        add: (value, error of a fault) -> value with that error.
        at: (value, simulated time in µs) -> value that claims to be of that time.
    """

    part: str
    field: str
    group: int
    unit: int
    switched_on: Callable[[Any, Setting, Chance], Measure]
    add: Callable[[Any, Vector], Any] = vector_sum
    at: Callable[[Any, int], Any] = as_it_is


class Rate:
    """Samples at the first frame at or after each multiple of its interval."""

    def __init__(self, rate_hz: float) -> None:
        """Be due first at the first frame."""
        self._rate_mhz = rate_hz * 1e-6
        self._samples = -1

    def is_due(self, time_us: int) -> bool:
        """Whether there is a sample at this frame; to be asked once a frame."""
        samples = int(time_us * self._rate_mhz + _ROUNDING)
        due = samples > self._samples
        self._samples = samples
        return due
