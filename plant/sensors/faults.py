"""What faults do to what sensors tell: each frame goes through them on its way out."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Generic, TypeAlias, TypeVar

from colibri.common.earth.geodesy import geodetic_of
from colibri.common.types import Vector
from colibri.mavlink.hil.faults import (
    ACCELEROMETER,
    BAROMETER,
    DELAYED,
    GARBAGE,
    GPS,
    GYROSCOPE,
    MAGNETOMETER,
    OFF,
    OK,
    SENSORS,
    SLOW,
    STUCK,
    WRONG,
    Fault,
)
from colibri.mavlink.hil.sensors import GpsFix, SensorFrame, Updated
from colibri.plant.environment.random_streams import Source, streams

T = TypeVar("T")
Add: TypeAlias = Callable[[T, Vector], T]
"""(value, error) -> value with that error."""
At: TypeAlias = Callable[[T, int], T]
"""(value, simulated time in µs) -> value that claims to be of that time."""

_GROUPS = {
    GYROSCOPE: Updated.GYROSCOPE,
    ACCELEROMETER: Updated.ACCELEROMETER,
    MAGNETOMETER: Updated.MAGNETOMETER,
    BAROMETER: Updated.BAROMETER,
}


class Reading(Generic[T]):
    """What one sensor tells, while it has a fault or none."""

    def __init__(self, add: Add[T], at: At[T], chance: Iterator[float]) -> None:
        """Be well; `chance` are standard normal numbers, drawn only for more noise."""
        self._add = add
        self._at = at
        self._chance = chance
        self._fault: Fault | None = None
        self._since_us = 0
        self._last: T | None = None
        self._later: deque[tuple[int, T]] = deque()

    def begin(self, fault: Fault, now_us: int, last: T | None) -> None:
        """Have a fault from now on, in place of any other; or none, where it is OK. `last` was told last."""
        self._fault = None if fault.kind == OK else fault
        self._since_us, self._last = now_us, last
        self._later.clear()

    def tell(self, now_us: int, value: T | None) -> T | None:
        """Return what is told of what is measured; either is None where there is nothing new."""
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

    def _late(self, now_us: int, value: T | None, late_us: int) -> T | None:
        if value is not None:
            self._later.append((now_us + late_us, value))
        told = None
        while self._later and self._later[0][0] <= now_us:
            told = self._later.popleft()[1]
        return None if told is None else self._at(told, now_us)


class SensorFaults:
    """The faults of all sensors of one vehicle."""

    def __init__(self, seed: int) -> None:
        """Have none; more noise will be by chance of `seed`."""
        chance = dict(zip(SENSORS, streams(seed, Source.FAULTS, len(SENSORS)), strict=True))
        vectors = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER)
        self._vectors = {unit: Reading[Vector](_sum, _as_it_is, chance[unit]) for unit in vectors}
        self._pressure = Reading[float](lambda pa, error: pa + error[0], _as_it_is, chance[BAROMETER])
        self._gps = Reading[GpsFix](_moved, lambda fix, now_us: replace(fix, time_us=now_us), chance[GPS])
        self._told: SensorFrame | None = None
        self._fix: GpsFix | None = None
        self._any = False

    def begin(self, fault: Fault, now_us: int) -> None:
        """Begin or end a fault; it shows from the next frame on."""
        self._any = True
        last = self._told
        if fault.unit == GPS:
            self._gps.begin(fault, now_us, self._fix)
        elif fault.unit == BAROMETER:
            self._pressure.begin(fault, now_us, None if last is None else last.pressure_pa)
        else:
            self._vectors[fault.unit].begin(fault, now_us, None if last is None else _vectors_of(last)[fault.unit])

    def through(self, frame: SensorFrame) -> SensorFrame:
        """Return what is told of a frame; each is the next one."""
        told = self._changed(frame, self._told or frame) if self._any else frame
        self._told, self._fix = told, told.gps or self._fix
        return told

    def _changed(self, frame: SensorFrame, before: SensorFrame) -> SensorFrame:
        now_us, updated = frame.time_us, 0
        measured, told = _vectors_of(frame), _vectors_of(before)
        for unit, reading in self._vectors.items():
            vector = reading.tell(now_us, measured[unit] if frame.has(_GROUPS[unit]) else None)
            if vector is not None:
                told[unit] = vector
                updated |= _GROUPS[unit]
        pressure_pa = self._pressure.tell(now_us, frame.pressure_pa if frame.has(Updated.BAROMETER) else None)
        if pressure_pa is not None:
            updated |= Updated.BAROMETER
        return replace(
            frame,
            updated=updated,
            specific_force_flu_m_s2=told[ACCELEROMETER],
            rate_flu_rad_s=told[GYROSCOPE],
            magnetic_field_flu_gauss=told[MAGNETOMETER],
            pressure_pa=before.pressure_pa if pressure_pa is None else pressure_pa,
            gps=self._gps.tell(now_us, frame.gps),
        )


def _vectors_of(frame: SensorFrame) -> dict[int, Vector]:
    return {
        GYROSCOPE: frame.rate_flu_rad_s,
        ACCELEROMETER: frame.specific_force_flu_m_s2,
        MAGNETOMETER: frame.magnetic_field_flu_gauss,
    }


def _as_it_is(value: T, _now_us: int) -> T:
    return value


def _sum(value: Vector, error: Vector) -> Vector:
    return (value[0] + error[0], value[1] + error[1], value[2] + error[2])


def _moved(fix: GpsFix, error: Vector) -> GpsFix:
    """Return a fix that is off by metres east, north and up; it claims to be as good as ever."""
    return replace(fix, place=geodetic_of(error, fix.place))
