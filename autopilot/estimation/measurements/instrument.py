"""The interface of a sensor to the estimator, and the gate, last test, and forced acceptance of a measurement."""

from collections.abc import Callable
from enum import IntEnum
from math import inf
from typing import Any, ClassVar, NamedTuple, Protocol, TypeAlias

import numpy as np

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.estimate import Test
from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected
from colibri.common.types import Array, Vector
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.vehicle.sensors import Sensors

Value: TypeAlias = tuple[float, ...]  # measurement at one instant, in SI
FIVE_SIGMA = (25.0, 28.74, 31.81)  # χ² of one, two and three degrees of freedom, as improbable as 5 σ


class KindRecord(NamedTuple):
    accepted_us: int
    rejected_us: int | None
    resets: int


class MeasurementKind:
    """One kind of measurement; `resets` counts forced acceptances."""

    def __init__(self, name: str, numbers: int, patience_us: int, inflated: tuple[int, int, float]) -> None:
        """After `patience_us` of rejection, inflate (first state, count, σ) and accept."""
        self.name = name
        self.gate = FIVE_SIGMA[numbers - 1]
        self.test = Test(-1, (0.0,) * numbers, 0.0, self.gate)
        self.accepted_us = 0
        self.rejected_us: int | None = None
        self._patience_us = patience_us
        self._inflated = inflated
        self._y = np.zeros(numbers)
        self.resets = 0
        self.nis = 0.0
        self.accepted = 0

    def fuse(self, x: Array, P: Array, time_us: int, kernel: Callable[..., float], *arguments: Any) -> bool:
        nis = kernel(x, P, *arguments, self.gate, self._y)
        if self.note(time_us, tuple(self._y.tolist()), nis):
            return True
        return self.force_accept(x, P, time_us, kernel, *arguments)

    def note(self, time_us: int, innovation: tuple[float, ...], nis: float) -> bool:
        self.test = Test(time_us, innovation, nis, self.gate)
        if nis <= self.gate:
            self.accepted_us, self.rejected_us = time_us, None
            self.nis += nis
            self.accepted += 1
            return True
        return False

    def force_accept(self, x: Array, P: Array, time_us: int, kernel: Callable[..., float], *arguments: Any) -> bool:
        """Accept a measurement by force after a long rejection."""
        if not self.reject(time_us):
            return False
        first, count, sigma = self._inflated
        update.inflate_covariance(P, first, count, sigma * sigma)
        kernel(x, P, *arguments, inf, self._y)
        self.reset(time_us)
        return True

    def reset(self, time_us: int) -> None:
        self.resets += 1
        self.accept(time_us)

    def accept(self, time_us: int) -> None:
        self.accepted_us = time_us
        self.rejected_us = None

    def reject(self, time_us: int) -> bool:
        if self.rejected_us is None:
            self.rejected_us = time_us
        return time_us - self.rejected_us >= self._patience_us

    def record(self) -> KindRecord:
        return KindRecord(self.accepted_us, self.rejected_us, self.resets)

    def resume(self, record: KindRecord) -> None:
        self.accepted_us, self.rejected_us, self.resets = record


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
