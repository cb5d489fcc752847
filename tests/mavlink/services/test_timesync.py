"""Timesync and ping: requests are answered to whoever asks, answers are not answered."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.mavlink.node.service import Send
from colibri.mavlink.services.timesync import TimeService
from tests.support.messages import GROUND, message, on_the_wire

INT64 = st.integers(-(2**63), 2**63 - 1)
UINT64 = st.integers(0, 2**64 - 1)


def answers(name: str, *fields: int, now_us: int = 0) -> list[Send]:
    return list(TimeService().receive(message(name, *fields), GROUND, now_us))


def test_timesync_tells_the_simulated_time() -> None:
    (send,) = answers("TIMESYNC", 0, 987_654_321, now_us=1_500_000)
    (answer,) = on_the_wire([send])
    assert send.channel == GROUND.channel
    assert (answer.fields.tc1, answer.fields.ts1) == (1_500_000_000, 987_654_321)


def test_an_answer_is_not_answered_and_nobody_sets_the_clock() -> None:
    assert answers("TIMESYNC", 5, 6) == []
    assert answers("PING", 5, 6, 1, 1) == []
    assert answers("SYSTEM_TIME", 1_800_000_000_000_000, 5) == []


@pytest.mark.parametrize("now_us", [0, 10**17])
@given(tc1=INT64, ts1=INT64)
def test_any_time_can_be_answered(now_us: int, tc1: int, ts1: int) -> None:
    on_the_wire(answers("TIMESYNC", tc1, ts1, now_us=now_us))
    on_the_wire(answers("TIMESYNC", 0, ts1, now_us=now_us))


@given(UINT64, st.integers(0, 2**32 - 1))
def test_any_ping_can_be_answered(time_us: int, sequence: int) -> None:
    (send,) = answers("PING", time_us, sequence, 0, 0)
    (answer,) = on_the_wire([send])
    assert send.channel == GROUND.channel
    assert list(answer.fields) == [time_us, sequence, GROUND.system, GROUND.component]
