"""What the estimator asks of a sensor: a value of each frame that can be, and that value fused."""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple, Protocol, TypeAlias

from colibri.autopilot.estimation.measurements.kind import Kind
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.vehicle.sensors import Sensors

Value: TypeAlias = tuple[float, ...]
"""What a sensor measured at one instant, in SI."""


class Ratio(IntEnum):
    """A ratio of ESTIMATOR_STATUS, in the order of its fields; the largest of its kinds is reported."""

    VELOCITY = 0
    POSITION = 1
    HEIGHT = 2
    FIELD = 3
    ABOVE_GROUND = 4
    AIRSPEED = 5


class Instrument(Protocol):
    """A sensor as the filter fuses it.

    Attributes:
        source: Whose rejections are counted.
        kind: Its tests.
        group: Of `Updated`; 0 where it tells in a message of its own.
        smoothed: Whether its corrections are given in with time, as those of GPS are.
    """

    source: str
    kind: Kind
    group: int
    smoothed: bool

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return what it measured at a frame; None where there is nothing new, or nothing that can be."""

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        """Fuse what it measured at the filter's time; return why it was rejected, if it was."""

    def typical(self) -> Value:
        """Return a value of a vehicle that rests at the origin, by which what is compiled is loaded."""
        ...


class Row(NamedTuple):
    """A sensor that may be fitted.

    Attributes:
        part: Table of the vehicle file's sensors; a vehicle without it has no such instrument.
        kind: Name of its measurement in tests and logs.
        numbers: How many it measures at once.
        source: Whose rejections are counted.
        bit: MAV_SYS_STATUS_SENSOR.
        ratio: By which ESTIMATOR_STATUS tells its tests.
        fit: (sensors, the earth's magnetic field in gauss ENU) -> the instrument of one flight.
    """

    part: str
    kind: str
    numbers: int
    source: str
    bit: int
    ratio: Ratio
    fit: Callable[[Sensors, Vector], Instrument]
