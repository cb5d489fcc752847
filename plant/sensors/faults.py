"""Faults of sensors, applied to each frame on its way out."""

from collections import deque
from typing import Any

from colibri.common.types import Vector
from colibri.mavlink.hil.faults import DELAYED, GARBAGE, OFF, OK, SENSORS, SLOW, STUCK, WRONG, Fault
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.environment.random_streams import Chance, RandomStream, streams
from colibri.plant.sensors.instrument import Instrument
from colibri.plant.sensors.table import ROWS, is_fitted
from colibri.plant.vehicle.sensors import Sensors


class SensorReading:
    """The output of one sensor, with or without a fault."""

    def __init__(self, row: Instrument, chance: Chance) -> None:
        self._add, self._at = row.add, row.at
        self._chance = chance
        self._fault: Fault | None = None
        self._since_us = 0
        self._last: Any = None
        self._later: deque[tuple[int, Any]] = deque()

    def begin(self, fault: Fault, now_us: int, last: Any) -> None:
        self._fault = None if fault.kind == OK else fault
        self._since_us, self._last = now_us, last
        self._later.clear()

    def report(self, now_us: int, value: Any) -> Any:
        """Return the output for a measurement; None without a new value."""
        fault = self._fault
        if fault is None:
            return value
        if fault.kind == DELAYED:
            return self._late(now_us, value, round(fault.values[0] * 1e6))
        if value is None or fault.kind == OFF:
            return None
        if fault.kind == STUCK:
            return None if self._last is None else self._at(self._last, now_us)
        return self._add(value, self._error(fault, now_us))

    def _error(self, fault: Fault, now_us: int) -> Vector:
        x, y, z, _ = fault.values
        if fault.kind == WRONG:
            return (x, y, z)
        if fault.kind == SLOW:
            elapsed_s = (now_us - self._since_us) * 1e-6
            return (x * elapsed_s, y * elapsed_s, z * elapsed_s)
        assert fault.kind == GARBAGE, "that is all that the table has"
        return (x * next(self._chance), x * next(self._chance), x * next(self._chance))

    def _late(self, now_us: int, value: Any, late_us: int) -> Any:
        if value is not None:
            self._later.append((now_us + late_us, value))
        reported = None
        while self._later and self._later[0][0] <= now_us:
            reported = self._later.popleft()[1]
        return None if reported is None else self._at(reported, now_us)


class SensorFaults:
    """Faults of all sensors of one vehicle, by FAILURE_UNIT."""

    def __init__(self, seed: int, parts: Sensors | None) -> None:
        chances = dict(zip(SENSORS, streams(seed, RandomStream.FAULTS, len(SENSORS)), strict=True))
        rows = [] if parts is None else [row for row in ROWS if is_fitted(row, parts)]
        self._readings = {row.unit: (row, SensorReading(row, chances[row.unit])) for row in rows}
        self.units = frozenset(self._readings)
        self._own = [row.field for row in rows if not row.group]
        self._reported: SensorFrame | None = None
        self._last: dict[str, Any] = {}
        self._any = False

    def begin(self, fault: Fault, now_us: int) -> None:
        self._any = True
        row, reading = self._readings[fault.unit]
        held = self._reported is not None and row.group
        reading.begin(fault, now_us, getattr(self._reported, row.field) if held else self._last.get(row.field))

    def through(self, frame: SensorFrame) -> SensorFrame:
        """Return the frame to send; call it once a frame."""
        reported = self._changed(frame, self._reported or frame) if self._any else frame
        self._reported = reported
        for field in self._own:
            if (value := getattr(reported, field)) is not None:
                self._last[field] = value
        return reported

    def _changed(self, frame: SensorFrame, before: SensorFrame) -> SensorFrame:
        now_us, updated, changes = frame.time_us, 0, dict[str, Any]()
        for row, reading in self._readings.values():
            is_new = frame.has(row.group)  # a message of its own is None where it is not
            value = reading.report(now_us, getattr(frame, row.field) if is_new else None)
            if value is not None:
                updated |= row.group
            changes[row.field] = getattr(before, row.field) if value is None and row.group else value
        return frame._replace(updated=updated, **changes)
