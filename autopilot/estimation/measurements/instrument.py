"""The interface of a sensor to the estimator: a value read from each frame, and that value fused."""

from enum import IntEnum
from typing import ClassVar, Protocol, TypeAlias

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
    """A sensor as the filter fuses it: a class for each that may be fitted, an instance for each flight.

    Attributes:
        part: Table of the vehicle file's sensors; a vehicle without it has no such instrument.
        name: Of its measurement in tests and logs.
        numbers: How many it measures at once.
        source: Whose rejections are counted.
        bit: MAV_SYS_STATUS_SENSOR.
        ratio: By which ESTIMATOR_STATUS reports its tests.
        group: Of `Updated`; 0 where it is measured in a message of its own.
        smoothed: Whether its corrections are given in with time, as those of GPS are.
    """

    part: ClassVar[str]
    name: ClassVar[str]
    numbers: ClassVar[int]
    source: ClassVar[str]
    bit: ClassVar[int]
    ratio: ClassVar[Ratio]
    group: ClassVar[int] = 0
    smoothed: ClassVar[bool] = False
    kind: Kind

    def __init__(self, sensors: Sensors, field_enu_gauss: Vector) -> None:
        """Begin a flight with `sensors` where the earth's magnetic field is `field_enu_gauss`."""

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return what it measured at a frame; None where there is nothing new, or nothing that can be."""

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        """Fuse what it measured at the filter's time; return why it was rejected, if it was."""

    def typical(self) -> Value:
        """Return a value of a vehicle that rests at the origin, by which what is compiled is loaded."""
