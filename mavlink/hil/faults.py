"""Faults by MAV_CMD_INJECT_FAILURE: https://mavlink.io/en/messages/common.html#MAV_CMD_INJECT_FAILURE.

param1 is the FAILURE_UNIT, param2 the FAILURE_TYPE, param3 the instance from 1, or 0 for all; `TABLE` defines param4 to
param7, where 0 and nan are not given. A new fault of a part replaces the last, OK ends it.
"""

from collections.abc import Collection, Mapping
from enum import StrEnum
from math import isfinite, isnan
from typing import Any, NamedTuple, TypeAlias

from colibri.common.errors import unknown
from colibri.mavlink.wire.dialect import RESULT_UNSUPPORTED, Codec, Refusal, mav

COMMAND: int = mav.MAV_CMD_INJECT_FAILURE
GYROSCOPE: int = mav.FAILURE_UNIT_SENSOR_GYRO
ACCELEROMETER: int = mav.FAILURE_UNIT_SENSOR_ACCEL
MAGNETOMETER: int = mav.FAILURE_UNIT_SENSOR_MAG
BAROMETER: int = mav.FAILURE_UNIT_SENSOR_BARO
GPS: int = mav.FAILURE_UNIT_SENSOR_GPS
RANGEFINDER: int = mav.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR
BATTERY: int = mav.FAILURE_UNIT_SYSTEM_BATTERY
MOTOR: int = mav.FAILURE_UNIT_SYSTEM_MOTOR
OK: int = mav.FAILURE_TYPE_OK
OFF: int = mav.FAILURE_TYPE_OFF
STUCK: int = mav.FAILURE_TYPE_STUCK
GARBAGE: int = mav.FAILURE_TYPE_GARBAGE
WRONG: int = mav.FAILURE_TYPE_WRONG
SLOW: int = mav.FAILURE_TYPE_SLOW
DELAYED: int = mav.FAILURE_TYPE_DELAYED

SENSORS = (GYROSCOPE, ACCELEROMETER, MAGNETOMETER, BAROMETER, GPS, RANGEFINDER)
ALL = 0  # the instance for all of a part
MOTORS = 4  # of a vehicle that is not known
FaultValues: TypeAlias = tuple[float, float, float, float]
_ROUNDING = 1e-6  # tolerance of limits, for the precision of the wire
_NOT_GIVEN: FaultValues = (0.0, 0.0, 0.0, 0.0)


class Equipment(StrEnum):
    ROTORS = "rotors"
    BATTERY = "battery"
    SENSORS = "sensors"  # the autopilot must use them, too: under state feedback a sensor fault has no effect


class Fault(NamedTuple):
    unit: int  # FAILURE_UNIT
    kind: int  # FAILURE_TYPE
    instance: int = ALL  # from 1
    values: FaultValues = _NOT_GIVEN  # param4 to param7


class Value(NamedTuple):
    name: str
    unit: str
    minimum: float
    maximum: float
    usual: float  # if no number is given
    rest: float  # if only others are given


class FaultRow(NamedTuple):
    """A kind of fault; `values` from param4 on."""

    unit: int
    kind: int
    part: Equipment
    meaning: str
    values: tuple[Value, ...] = ()


def _scalar(name: str, unit: str, minimum: float, maximum: float, usual: float) -> Value:
    return Value(name, unit, minimum, maximum, usual, usual)


def _errors(name: str, unit: str, maximum: float, usual: float, axis: str) -> tuple[Value, ...]:
    if not axis:
        return (Value(name, unit, -maximum, maximum, usual, usual),)
    return tuple(Value(f"{name} {each}", unit, -maximum, maximum, usual * (each == axis), 0.0) for each in "xyz")


def _sensor(
    unit: int,
    wrong: tuple[str, str, float, float],
    drift: tuple[str, float, float],
    noise: tuple[float, float, float],
    axis: str = "",
) -> tuple[FaultRow, ...]:
    """Return a sensor's faults: name, unit, limit and usual value of its errors along an axis, limits of its noise."""
    deviation, late = _scalar("standard deviation", wrong[1], *noise), _scalar("late by", "s", 0.001, 10.0, 0.2)
    part = Equipment.SENSORS
    return (
        FaultRow(unit, OK, part, "normal again"),
        FaultRow(unit, OFF, part, "no new measurements"),
        FaultRow(unit, STUCK, part, "repeats its last value as new"),
        FaultRow(unit, GARBAGE, part, "adds white Gaussian noise", (deviation,)),
        FaultRow(unit, WRONG, part, "adds a constant error", _errors(*wrong, axis)),
        FaultRow(unit, SLOW, part, "adds an error that grows from zero", _errors("drift", *drift, axis)),
        FaultRow(unit, DELAYED, part, "delays measurements", (late,)),
    )


ROWS: tuple[FaultRow, ...] = (
    *_sensor(GYROSCOPE, ("bias", "rad/s", 20.0, 0.1), ("rad/s²", 1.0, 0.01), (1e-4, 20.0, 0.5), "x"),
    *_sensor(ACCELEROMETER, ("bias", "m/s²", 100.0, 2.0), ("m/s³", 10.0, 0.1), (1e-3, 100.0, 5.0), "z"),
    *_sensor(MAGNETOMETER, ("bias", "gauss", 10.0, 0.2), ("gauss/s", 1.0, 0.01), (1e-4, 10.0, 0.3), "x"),
    *_sensor(BAROMETER, ("bias", "Pa", 20000.0, 100.0), ("Pa/s", 1000.0, 5.0), (0.1, 20000.0, 200.0)),
    *_sensor(GPS, ("jump", "m", 10000.0, 10.0), ("m/s", 100.0, 0.5), (0.01, 1000.0, 10.0), "x"),
    *_sensor(RANGEFINDER, ("bias", "m", 100.0, 1.0), ("m/s", 10.0, 0.05), (0.001, 100.0, 0.5)),
    FaultRow(BATTERY, OK, Equipment.BATTERY, "normal again, with the charge that the fault removed"),
    FaultRow(BATTERY, OFF, Equipment.BATTERY, "empty: voltage at zero charge"),
    FaultRow(
        *(BATTERY, WRONG, Equipment.BATTERY, "sags: less charge and voltage, changed resistance"),
        values=(
            Value("remaining fraction of the full charge", "1", 1e-3, 1.0, 0.2, 0.2),
            Value("factor of the resistance", "1", 0.1, 10.0, 1.0, 1.0),
        ),
    ),
    FaultRow(MOTOR, OK, Equipment.ROTORS, "normal again"),
    FaultRow(MOTOR, OFF, Equipment.ROTORS, "lost: undriven, runs down"),
    FaultRow(MOTOR, STUCK, Equipment.ROTORS, "keeps its present speed"),
    FaultRow(
        *(MOTOR, WRONG, Equipment.ROTORS, "weak: a fraction of thrust and torque"),
        values=(_scalar("remaining fraction", "1", 1e-3, 1.0, 0.65),),
    ),
)
TABLE: Mapping[tuple[int, int], FaultRow] = {(row.unit, row.kind): row for row in ROWS}
"""Faults that a plant may support."""


def unit_name(unit: int) -> str:
    return str(mav.enums["FAILURE_UNIT"][unit].name).removeprefix("FAILURE_UNIT_")


def kind_name(kind: int) -> str:
    return str(mav.enums["FAILURE_TYPE"][kind].name).removeprefix("FAILURE_TYPE_")


def short_unit_name(unit: int) -> str:
    return _short(unit_name(unit))


def number_of(enum: str, given: str | int) -> int:
    """Return the number of a FAILURE_UNIT or FAILURE_TYPE; raise `ValueError` for an unknown name."""
    __tracebackhide__ = True  # a failed test shows its own lines
    if isinstance(given, int):
        return given
    known = {
        _short(each.name.removeprefix(f"{enum}_")): number
        for number, each in mav.enums[enum].items()
        if not each.name.endswith("_ENUM_END")
    }
    if _short(given) not in known:
        raise ValueError(unknown(f"{enum.removeprefix('FAILURE_').lower()} of a failure", _short(given), sorted(known)))
    return int(known[_short(given)])


def _short(unit: str) -> str:
    return unit.lower().removeprefix("system_").removeprefix("sensor_")


def fault_from(p1: float, p2: float, p3: float, values: FaultValues) -> Fault | None:
    p3 = 0.0 if isnan(p3) else p3
    if not all(isfinite(number) and number == int(number) for number in (p1, p2, p3)):
        return None
    return Fault(int(p1), int(p2), int(p3), values)


def judged(fault: Fault, parts: Collection[Equipment], motors: int = MOTORS) -> Fault | Refusal:
    """Return a fault with its numbers complete, or its refusal by a plant with these `parts`."""
    row = TABLE.get((fault.unit, fault.kind))
    if row is None:
        return Refusal("no plant does this fault", RESULT_UNSUPPORTED)
    if row.part not in parts:
        without = "flown by the state, not by sensors" if row.part is Equipment.SENSORS else f"no {row.part} to fail"
        return Refusal(without, RESULT_UNSUPPORTED)
    instances = motors if row.unit == MOTOR else 1
    if not 0 <= fault.instance <= instances:
        return Refusal(f"instance must be 0 to {instances}")
    return _with_values(row, fault)


def encode_fault(codec: Codec, fault: Fault, target: tuple[int, int]) -> bytes:
    return codec.encode("COMMAND_LONG", *target, COMMAND, 0, fault.unit, fault.kind, fault.instance, *fault.values)


def decode_fault(fields: Any) -> Fault | None:
    values = (fields.param4, fields.param5, fields.param6, fields.param7)
    return fault_from(fields.param1, fields.param2, fields.param3, values)


def _with_values(row: FaultRow, fault: Fault) -> Fault | Refusal:
    given = [0.0 if isnan(value) else value for value in fault.values[: len(row.values)]]
    some = any(given)
    taken = [value or (it.rest if some else it.usual) for value, it in zip(given, row.values, strict=True)]
    for value, it in zip(taken, row.values, strict=True):
        slack = _ROUNDING * max(abs(it.minimum), abs(it.maximum))
        if value and not it.minimum - slack <= value <= it.maximum + slack:
            unit = "" if it.unit == "1" else f" {it.unit}"
            return Refusal(f"{it.name} must be {it.minimum:g} to {it.maximum:g}{unit}")
    a, b, c, d = (*taken, *_NOT_GIVEN)[: len(_NOT_GIVEN)]
    return fault._replace(values=(a, b, c, d))
