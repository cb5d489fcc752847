"""The interface of a sensor to the estimator."""

from enum import IntEnum
from typing import ClassVar, Protocol, TypeAlias

from colibri.autopilot.estimation.measurements.kind import MeasurementKind
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.vehicle.sensors import Sensors

Value: TypeAlias = tuple[float, ...]  # measurement at one instant, in SI


class Ratio(IntEnum):
    """A ratio of ESTIMATOR_STATUS, in field order."""

    VELOCITY = 0
    POSITION = 1
    HEIGHT = 2
    FIELD = 3
    ABOVE_GROUND = 4
    AIRSPEED = 5


class FusedInstrument(Protocol):
    """A sensor fused without delay; one instance for each flight."""

    part: ClassVar[str]  # table in the vehicle file
    name: ClassVar[str]  # measurement in tests and logs
    numbers: ClassVar[int]  # values in a measurement
    source: ClassVar[str]
    bit: ClassVar[int]  # MAV_SYS_STATUS_SENSOR
    ratio: ClassVar[Ratio]
    group: ClassVar[int] = 0  # flag of `Updated`; 0 with its own message
    smoothed: ClassVar[bool] = False  # whether corrections pass the output smoothing
    kind: MeasurementKind

    def __init__(self, sensors: Sensors, field_enu_gauss: Vector) -> None: ...

    def read(self, frame: SensorFrame, rejected: Rejected) -> Value | None: ...

    def fuse(self, x: Array, P: Array, value: Value, time_us: int) -> Reason | None:
        """Fuse a value at the filter's time; return the reason of a rejection."""

    def typical(self) -> Value:
        """Return a value at rest, to load compiled code."""
