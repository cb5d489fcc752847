from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.client.clock import VehicleClock
from colibri.mavlink.client.report import VehicleReport
from colibri.mavlink.client.states import StateAssembler
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import Codec, Message

VEHICLE = Codec(1, 1)
NO_COVARIANCE = (0.0,) * 21


def said(name: str, *fields: Any) -> Message:
    (message,) = Codec(0, 0).decode(VEHICLE.encode(name, *fields))
    return message


def exchanged(clock: VehicleClock, offset_us: int, ways_us: list[tuple[int, int]], from_us: int = 0) -> int:
    """Exchange TIMESYNC with a vehicle whose clock is ahead; return when the last came back."""
    now_us = from_us
    for there_us, back_us in ways_us:
        asked = clock.request(now_us)
        assert asked is not None
        clock.receive((now_us + there_us + offset_us) * 1000, asked[1], now_us + there_us + back_us)
        now_us += 100_000
    return now_us


@given(seed=st.integers(0, 10_000), offset_us=st.integers(-(10**12), 10**12))
def test_the_clock_s_offset_is_as_good_as_the_quickest_exchange(seed: int, offset_us: int) -> None:
    clock, chance = VehicleClock(), Random(seed)
    ways_us = [(20_000 + chance.randrange(10_000), 20_000 + chance.randrange(10_000)) for _ in range(40)]
    now_us = exchanged(clock, offset_us, ways_us, 10**9)
    assert clock.known
    assert abs(clock.own_us(now_us + offset_us) - now_us) <= 5_000
    assert 40_000 <= clock.round_trip_us <= 60_000


def test_a_vehicle_that_was_started_again_has_another_clock() -> None:
    clock = VehicleClock()
    now_us = exchanged(clock, 5_000_000, [(1000, 1000)] * 20)
    now_us = exchanged(clock, -9_000_000, [(1000, 1000)] * 8, now_us)
    assert abs(clock.own_us(now_us - 9_000_000) - now_us) <= 1_000


@pytest.mark.parametrize("drift", [0.0, -0.016, -0.1, 0.03])
def test_a_drifting_clock_of_a_simulator_is_followed(drift: float) -> None:
    clock, chance, unknown = VehicleClock(), Random(5), 0
    for n in range(300):
        now_us = 100_000 * n
        asked = clock.request(now_us)
        assert asked
        there_us, back_us = 100 + chance.randrange(1500), 100 + chance.randrange(1500)
        vehicle_us = 3_000_000 + round((now_us + there_us) * (1.0 + drift))
        clock.receive(vehicle_us * 1000, asked[1], now_us + there_us + back_us)
        unknown += n > 5 and not clock.known
        later_us = now_us + 90_000
        if n > 50:
            assert abs(clock.own_us(3_000_000 + round(later_us * (1.0 + drift))) - later_us) <= 2_500
    assert not unknown


@pytest.mark.parametrize("rate", [0.5, 1.0, 3.0])
def test_a_clock_that_is_not_of_real_time_is_told_from_silence(rate: float) -> None:
    clock = VehicleClock()
    assert (clock.rate, clock.answered_us) == (1.0, None)
    for now_us in range(0, 3_000_000, 100_000):
        asked = clock.request(now_us)
        assert asked is not None
        clock.receive(round(rate * now_us) * 1000 + 1, asked[1], now_us + 2_000)
    assert clock.answered_us == 2_902_000
    assert clock.rate == pytest.approx(rate, rel=0.02)


def test_what_is_no_answer_says_nothing_of_the_clock() -> None:
    clock = VehicleClock()
    clock.receive(0, 1_000_000, 2_000)
    clock.receive(5, -(10**15), 2_000)
    clock.receive(5, 10**15, 2_000)
    assert not clock.known
    with pytest.raises(ValueError, match="TIMESYNC"):
        clock.own_us(0)


def test_a_state_is_in_enu_and_flu_by_any_messages() -> None:
    rate, q = (0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0)
    odometry = StateAssembler().receive(
        said("ODOMETRY", 20_000, 1, 12, 1.0, 2.0, -3.0, q, 0.5, 0.0, 0.0, *rate, NO_COVARIANCE, NO_COVARIANCE, 0, 8, 9),
        0,
    )
    apart = StateAssembler()
    assert apart.receive(said("LOCAL_POSITION_NED", 20, 1.0, 2.0, -3.0, 0.5, 0.0, 0.0), 0) is None
    quaternion = apart.receive(said("ATTITUDE_QUATERNION", 20, *q, *rate), 0)
    euler = StateAssembler()
    euler.receive(said("LOCAL_POSITION_NED", 20, 1.0, 2.0, -3.0, 0.5, 0.0, 0.0), 0)
    angles = euler.receive(said("ATTITUDE", 20, 0.0, 0.0, 0.0, *rate), 0)
    for state in (odometry, quaternion, angles):
        assert isinstance(state, StateFrame)
        assert state.time_us == 20_000
        assert state.position_enu_m == pytest.approx((2.0, 1.0, 3.0))
        assert state.velocity_enu_m_s == pytest.approx((0.0, 0.5, 0.0))
        assert state.rate_flu_rad_s == pytest.approx((0.1, -0.2, -0.3))
        assert state.attitude == pytest.approx((0.5**0.5, 0.0, 0.0, 0.5**0.5))


def test_a_state_is_neither_old_nor_without_number() -> None:
    states, nan, q = StateAssembler(), float("nan"), (1.0, 0.0, 0.0, 0.0)

    def odometry(time_us: int, x: float, frame: int = 1) -> StateFrame | None:
        rest = (0.0,) * 6
        fields = (time_us, frame, 12, x, 0.0, 0.0, q, *rest, NO_COVARIANCE, NO_COVARIANCE, 0, 8, 9)
        return states.receive(said("ODOMETRY", *fields), 0)

    assert odometry(50_000, 1.0)
    assert odometry(40_000, 1.0) is None
    assert odometry(60_000, nan) is None
    assert odometry(70_000, 1.0, frame=20) is None
    assert states.refused == 1


def test_an_old_mode_after_a_new_one_is_none() -> None:
    report, codec, reads = VehicleReport(), Codec(1, 1), Codec(0, 0)
    first, second = (codec.encode("CURRENT_MODE", 0, mode, mode) for mode in (7, 9))
    for frame in (second, first):
        report.receive(reads.decode(frame)[0], 0)
    assert report.mode == 9
