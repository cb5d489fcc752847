from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.hil.faults import (
    ACCELEROMETER,
    BATTERY,
    GPS,
    GYROSCOPE,
    MOTOR,
    OFF,
    ROWS,
    SLOW,
    TABLE,
    WRONG,
    Equipment,
    Fault,
    FaultRow,
    fault_from,
    judged,
)
from colibri.mavlink.hil.plant_status import NO_BATTERY, PlantBattery, decode_battery, encode_battery
from colibri.mavlink.wire.dialect import RESULT_DENIED, RESULT_UNSUPPORTED, Codec, Refusal

ALL_PARTS = list(Equipment)
ANYTHING = st.floats(allow_nan=True, allow_infinity=True)


def refusal(fault: Fault, parts: list[Equipment] = ALL_PARTS) -> Refusal:
    judgement = judged(fault, parts)
    assert isinstance(judgement, Refusal)
    return judgement


def test_no_fault_is_told_twice() -> None:
    assert len(TABLE) == len(ROWS)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.unit}-{row.kind}")
def test_each_has_usual_numbers_within_its_limits(row: FaultRow) -> None:
    fault = judged(Fault(row.unit, row.kind), ALL_PARTS)
    assert isinstance(fault, Fault)
    assert fault.values[: len(row.values)] == tuple(value.usual for value in row.values)
    assert judged(fault, ALL_PARTS) == fault
    assert all(value.minimum <= value.usual <= value.maximum for value in row.values)


def test_a_number_that_is_not_given_is_none_beside_one_that_is() -> None:
    assert judged(Fault(GPS, WRONG, 0, (nan, 5.0, nan, 7.0)), ALL_PARTS) == Fault(GPS, WRONG, 0, (0.0, 5.0, 0.0, 0.0))
    assert judged(Fault(BATTERY, WRONG, 0, (0.3, 0.0, 0.0, 0.0)), ALL_PARTS) == Fault(
        BATTERY, WRONG, 0, (0.3, 1.0, 0.0, 0.0)
    )


def test_what_cannot_be_is_denied_with_words() -> None:
    assert refusal(Fault(MOTOR, WRONG, 1, (1.5, 0.0, 0.0, 0.0))) == Refusal("remaining fraction must be 0.001 to 1")
    assert refusal(Fault(GYROSCOPE, WRONG, 0, (inf, 0.0, 0.0, 0.0))) == Refusal("bias x must be -20 to 20 rad/s")
    assert refusal(Fault(MOTOR, OFF, 5)) == Refusal("instance must be 0 to 4")
    assert refusal(Fault(GPS, OFF, 2)).result == RESULT_DENIED


def test_what_no_plant_does_is_not_supported() -> None:
    assert refusal(Fault(MOTOR, SLOW)) == Refusal("no plant does this fault", RESULT_UNSUPPORTED)
    assert refusal(Fault(104, OFF)).result == RESULT_UNSUPPORTED
    assert refusal(Fault(ACCELEROMETER, OFF), [Equipment.ROTORS]) == Refusal(
        "flown by the state, not by sensors", RESULT_UNSUPPORTED
    )
    assert refusal(Fault(BATTERY, OFF), [Equipment.ROTORS]) == Refusal("no battery to fail", RESULT_UNSUPPORTED)


@given(ANYTHING, ANYTHING, ANYTHING, st.tuples(ANYTHING, ANYTHING, ANYTHING, ANYTHING))
def test_any_numbers_are_a_fault_within_limits_or_none(
    p1: float, p2: float, p3: float, values: tuple[float, float, float, float]
) -> None:
    asked = fault_from(p1, p2, p3, values)
    if asked is None:
        return
    fault = judged(asked, ALL_PARTS)
    if isinstance(fault, Fault):
        for value, it in zip(fault.values, TABLE[fault.unit, fault.kind].values, strict=False):
            assert it.minimum <= value * (1.0 - 1e-6) or it.minimum <= value * (1.0 + 1e-6) or value == it.rest
            assert abs(value) <= 1.0001 * max(abs(it.minimum), abs(it.maximum))


@pytest.mark.parametrize(
    "battery", [PlantBattery(16.8, 0.0, 0.0, 1.0), PlantBattery(9.61, 21.34, 1.234, 0.25), NO_BATTERY]
)
def test_a_battery_goes_over_the_wire(battery: PlantBattery) -> None:
    codec = Codec(1, 2)
    (message,) = codec.decode(encode_battery(codec, battery))
    assert decode_battery(message) == pytest.approx(battery, nan_ok=True)


def test_a_battery_that_tells_nothing_is_none() -> None:
    codec = Codec(1, 2)
    nothing = codec.encode("BATTERY_STATUS", 0, 0, 0, 32767, (65535,) * 10, -1, -1, -1, -1)
    assert decode_battery(codec.decode(nothing)[0]) is None
