from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.setpoints.manual_control import UNCHANGED, UNUSED, Manual
from colibri.mavlink.setpoints.setpoints import Sticks
from tests.support.streamed import FIRST, message, messages

SYSTEM = 7


@pytest.fixture
def manual() -> Manual:
    return Manual(SYSTEM)


def sticks(service: Manual, x: int, y: int, z: int, r: int, target: int = SYSTEM) -> Sticks | None:
    service.receive(message("MANUAL_CONTROL", target=target, x=x, y=y, z=z, r=r), FIRST, 1_000)
    return service.latest(1_000, 0)


def channels(service: Manual, *raw: int, now_us: int = 1_000) -> Sticks | None:
    wire = {f"chan{number}_raw": value for number, value in enumerate(raw, start=1)}
    service.receive(message("RC_CHANNELS_OVERRIDE", target_system=SYSTEM, **wire), FIRST, now_us)
    return service.latest(now_us, 0)


@pytest.mark.parametrize(
    ("wire", "expected"),
    [
        ((1000, 0, 500, 0), Sticks(1.0, 0.0, 0.5, 0.0, 1_000)),
        ((0, -1000, 0, 0), Sticks(0.0, -1.0, 0.0, 0.0, 1_000)),
        ((0, 0, 1000, 250), Sticks(0.0, 0.0, 1.0, 0.25, 1_000)),
        ((0, 0, -400, 0), Sticks(0.0, 0.0, 0.0, 0.0, 1_000)),
        ((UNUSED, UNUSED, UNUSED, UNUSED), Sticks(0.0, 0.0, 0.5, 0.0, 1_000)),
    ],
)
def test_sticks(manual: Manual, wire: tuple[int, int, int, int], expected: Sticks) -> None:
    assert sticks(manual, *wire) == expected


@pytest.mark.parametrize("axis", range(4))
@pytest.mark.parametrize("value", [1001, -1001, -0x8000, UNUSED - 1])
def test_a_stick_out_of_range_drops_all_and_keeps_nothing_alive(manual: Manual, axis: int, value: int) -> None:
    wire = [100, 100, 100, 100]
    wire[axis] = value
    x, y, z, r = wire
    assert sticks(manual, x, y, z, r) is None
    assert manual.dropped == {"out of range": 1}


def test_only_this_vehicle_is_steered(manual: Manual) -> None:
    assert sticks(manual, 1, 1, 1, 1, target=SYSTEM + 1) is None
    assert manual.dropped == {"another vehicle": 1}
    assert sticks(manual, 1, 1, 1, 1, target=0) is not None


def test_sticks_grow_old(manual: Manual) -> None:
    sticks(manual, 0, 0, 500, 0)
    assert manual.latest(501_000, 500_000) is not None
    assert manual.latest(501_001, 500_000) is None


def test_channels_are_aileron_elevator_throttle_rudder(manual: Manual) -> None:
    assert channels(manual, 2000, 1500, 1500, 1500) == Sticks(0.0, 1.0, 0.5, 0.0, 1_000)
    assert channels(manual, 1500, 1000, 1500, 1500) == Sticks(1.0, 0.0, 0.5, 0.0, 1_000)
    assert channels(manual, 1500, 1500, 1000, 1500) == Sticks(0.0, 0.0, 0.0, 0.0, 1_000)
    assert channels(manual, 1500, 1500, 2000, 1750) == Sticks(0.0, 0.0, 1.0, 0.5, 1_000)
    assert channels(manual, 2150, 850, 800, 2200) == Sticks(1.0, 1.0, 0.0, 1.0, 1_000)


def test_released_and_unchanged_channels(manual: Manual) -> None:
    assert channels(manual, 0, 0, 1800, 0) == Sticks(0.0, 0.0, 0.8, 0.0, 1_000)
    kept = channels(manual, 1750, UNCHANGED, UNCHANGED, UNCHANGED, now_us=2_000)
    assert kept == Sticks(0.0, 0.5, 0.8, 0.0, 2_000)
    assert channels(manual, UNCHANGED, UNCHANGED, UNCHANGED, UNCHANGED, now_us=3_000) == Sticks(
        0.0, 0.5, 0.8, 0.0, 3_000
    )
    assert channels(manual, 0, 0, 0, 0, now_us=4_000) is None
    assert manual.latest(4_000, 10**9) is None


def test_unchanged_channels_alone_are_no_sticks(manual: Manual) -> None:
    assert channels(manual, UNCHANGED, UNCHANGED, UNCHANGED, UNCHANGED) is None
    assert channels(manual, 0, 0, 0, 0, 1500, 1500) is None
    assert not manual.dropped


def test_what_was_held_before_a_silence_is_forgotten(manual: Manual) -> None:
    channels(manual, 2000, 1500, 1000, 1500, now_us=0)
    later = channels(manual, UNCHANGED, 1500, UNCHANGED, UNCHANGED, now_us=600_000)
    assert later == Sticks(0.0, 0.0, 0.5, 0.0, 600_000)


@pytest.mark.parametrize("value", [1, 799, 2201, 0xFFFE])
def test_a_channel_out_of_range_drops_all(manual: Manual, value: int) -> None:
    assert channels(manual, 1500, 1500, 1500, value) is None
    assert manual.dropped == {"out of range": 1}


@given(st.lists(messages("MANUAL_CONTROL") | messages("RC_CHANNELS_OVERRIDE"), max_size=10))
def test_whatever_the_fields_hold(received: list[Any]) -> None:
    manual = Manual(SYSTEM)
    for number, each in enumerate(received):
        assert list(manual.receive(each, FIRST, 1_000 * number)) == []
        latest = manual.latest(1_000 * number, 10**9)
        if latest is not None:
            assert all(-1.0 <= value <= 1.0 for value in latest[:4])
            assert 0.0 <= latest.thrust <= 1.0
