"""The interface of a sensor to the estimator."""

from enum import IntEnum
from typing import ClassVar, Protocol, TypeAlias

from colibri.autopilot.estimation.measurements.kind import Kind
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.vehicle.sensors import Sensors

Value: TypeAlias = tuple[float, ...]
"""Measurement at one instant, in SI."""


class Ratio(IntEnum):
    """A ratio of ESTIMATOR_STATUS, in field order; the largest of its measurements is reported."""

    VELOCITY = 0
    POSITION = 1
    HEIGHT = 2
    FIELD = 3
    ABOVE_GROUND = 4
    AIRSPEED = 5


class Instrument(Protocol):
    """A sensor fused without delay: one class for each sensor, one instance for each flight.

    Attributes:
        part: Table in the vehicle file; without it the sensor is not fitted.
        name: Name of the measurement in tests and logs.
        numbers: Values in a measurement.
        source: Sensor name in rejections.
        bit: MAV_SYS_STATUS_SENSOR.
        group: Flag of `Updated`; 0 for a sensor with its own message.
        smoothed: Whether its corrections pass the output smoothing, like those of GPS.
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

    def __init__(self, sensors: Sensors, field_enu_gauss: Vector) -> None: ...

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None:
        """Return a new and plausible measurement."""

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        """Fuse a measurement at the filter's time; return the reason of a rejection."""

    def typical(self) -> Value:
        """Return a value at rest at the origin, to load compiled code."""
