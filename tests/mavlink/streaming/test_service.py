from collections import Counter
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.services.command import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED, ReceivedCommand
from colibri.mavlink.streaming.rates import DEFAULTS, GCS, GROUPS, SDK, SILENT
from colibri.mavlink.streaming.service import MAX_WAITING, StreamService
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import Refusal, mav
from tests.support.messages import FLOATS, GROUND, NAN, OTHER, PEERS, message, on_the_wire
from tests.support.snapshots import FLYING, TELEMETRY

FRAME_US = 4_000
ATTITUDE, HOME, HEARTBEAT = 30, 242, 0
SET, GET, REQUEST = 511, 510, 512

MESSAGE_IDS = FLOATS | st.sampled_from([30.0, 242.0, 244.0])


def flying(kind: str = SILENT) -> StreamService:
    stream = StreamService(TELEMETRY)
    stream.provide("AUTOPILOT_VERSION", lambda command: [to(command.peer, "AUTOPILOT_VERSION")])
    stream.update(FLYING)
    for peer in (GROUND, OTHER):
        stream.use(peer.channel, kind)
        stream.opened(peer.channel, 0)
    return stream


def ask(stream: StreamService, command: int, p1: float, p2: float = 0.0, peer: Peer = GROUND) -> int:
    handler: Any = stream.handlers()[command]
    refusal: Refusal | None = handler(ReceivedCommand(command, p1, p2, 0.0, 0.0, 0.0, 0.0, 0.0, None, peer, 0))
    return ACCEPTED if refusal is None else refusal.result


def fly(stream: StreamService, from_us: int, until_us: int, frame_us: int = FRAME_US) -> list[tuple[int, Send]]:
    sends = []
    for now_us in range(from_us, until_us, frame_us):
        stream.update(FLYING._replace(time_us=now_us))
        sends += [(now_us, send) for send in stream.poll(now_us)]
    return sends


def counts(sends: list[tuple[int, Send]], channel: int = GROUND.channel) -> Counter[str]:
    return Counter(send.name for _, send in sends if send.channel == channel)


@pytest.mark.parametrize("kind", [SDK, GCS])
def test_the_defaults_hold_over_a_minute(kind: str) -> None:
    sends = fly(flying(kind), 0, 60_000_000, 4 * FRAME_US if kind == GCS else FRAME_US)
    for peer in (GROUND, OTHER):
        told = counts(sends, peer.channel)
        assert told.keys() == DEFAULTS[kind].keys()
        for name, interval_us in DEFAULTS[kind].items():
            each = 9 if name == "NAMED_VALUE_FLOAT" else 1
            assert told[name] / each == pytest.approx(60e6 / interval_us, abs=1.0), name


def test_every_default_and_every_group_can_be_told() -> None:
    every = (*DEFAULTS.values(), *GROUPS.values())
    assert {name for names in every for name in names} <= TELEMETRY.keys()


def test_frames_share_the_messages() -> None:
    """A second of the SDK's streams has about 430 messages in 250 frames: none may have many of them."""
    sends = fly(flying(SDK), 0, 10_000_000)
    of_a_frame = Counter(now_us for now_us, send in sends if send.channel == GROUND.channel)
    assert max(of_a_frame.values()) < 18
    assert len(of_a_frame) > 0.7 * 2500


@settings(max_examples=30)
@given(st.integers(1_000, 3_000_000), st.integers(1_000, 50_000), st.integers(0, 10**12))
def test_intervals_do_not_drift(interval_us: int, frame_us: int, start_us: int) -> None:
    stream = flying()
    ask(stream, SET, ATTITUDE, float(interval_us))
    stream.poll(start_us)
    frames = 500
    sends = fly(stream, start_us + frame_us, start_us + (frames + 1) * frame_us, frame_us)
    wanted = min(frames, frames * frame_us / max(interval_us, 1000))
    assert len(sends) == pytest.approx(wanted, abs=1.0)


def test_a_jump_of_the_clock_is_no_burst() -> None:
    stream = flying(SDK)
    fly(stream, 0, 1_000_000)
    names = counts([(0, send) for send in stream.poll(3_600_000_000)])
    assert all(count == 1 for name, count in names.items() if name != "NAMED_VALUE_FLOAT")
    assert counts(fly(stream, 3_600_004_000, 3_601_004_000))["ATTITUDE"] == pytest.approx(100, abs=1)


def test_a_closed_channel_gets_nothing() -> None:
    stream = flying(SDK)
    ask(stream, REQUEST, ATTITUDE)
    stream.closed(GROUND.channel)
    sends = fly(stream, 0, 1_000_000)
    assert counts(sends) == {}
    assert counts(sends, OTHER.channel)["ATTITUDE"] > 90


def test_a_channel_may_change_its_kind() -> None:
    stream = flying(GCS)
    stream.use(GROUND.channel, SDK)
    sends = fly(stream, 0, 1_000_000)
    assert counts(sends)["ATTITUDE"] == pytest.approx(100, abs=1)
    assert counts(sends, OTHER.channel)["ATTITUDE"] == pytest.approx(10, abs=1)


def test_an_unspecified_channel_is_a_ground_station() -> None:
    stream = StreamService(TELEMETRY)
    stream.opened(7, 0)
    assert stream.interval_us(7, "ATTITUDE") == DEFAULTS[GCS]["ATTITUDE"]


@pytest.mark.parametrize(
    ("command", "p1", "p2", "result"),
    [
        (SET, ATTITUDE, 1e5, ACCEPTED),
        (SET, ATTITUDE, -1.0, ACCEPTED),
        (SET, ATTITUDE, 0.0, ACCEPTED),
        (SET, ATTITUDE, -2.0, DENIED),
        (SET, ATTITUDE, NAN, DENIED),
        (SET, ATTITUDE, float("inf"), DENIED),
        (SET, ATTITUDE, 1e12, DENIED),
        (SET, HEARTBEAT, 1e5, DENIED),
        (SET, 148.0, 1e5, DENIED),
        (SET, 246.0, 1e5, UNSUPPORTED),
        (SET, 30.5, 1e5, UNSUPPORTED),
        (SET, NAN, 1e5, UNSUPPORTED),
        (SET, -1.0, 1e5, UNSUPPORTED),
        (SET, float("inf"), 1e5, UNSUPPORTED),
        (GET, 246, 0.0, UNSUPPORTED),
        (GET, NAN, 0.0, UNSUPPORTED),
        (REQUEST, mav.MAVLINK_MSG_ID_MESSAGE_INTERVAL, 246, UNSUPPORTED),
        (REQUEST, mav.MAVLINK_MSG_ID_MESSAGE_INTERVAL, 1e9, UNSUPPORTED),
        (REQUEST, 300, 0.0, UNSUPPORTED),
        (REQUEST, 9999, 0.0, UNSUPPORTED),
        (REQUEST, NAN, 0.0, UNSUPPORTED),
        (REQUEST, -5.0, 0.0, UNSUPPORTED),
    ],
)
def test_what_can_be_asked_for(command: int, p1: float, p2: float, result: int) -> None:
    assert ask(flying(SDK), command, p1, p2) == result


def test_an_interval_is_set_switched_off_and_set_back() -> None:
    stream = flying(SDK)
    for p2, interval_us in ((2e5, 200_000), (-1.0, None), (0.0, 10_000)):
        ask(stream, SET, ATTITUDE, p2)
        assert stream.interval_us(GROUND.channel, "ATTITUDE") == interval_us
        assert stream.interval_us(OTHER.channel, "ATTITUDE") == 10_000


@pytest.mark.parametrize(("message_id", "interval_us"), [(ATTITUDE, 10_000), (148, -1), (HEARTBEAT, 1_000_000)])
@pytest.mark.parametrize("way", [GET, REQUEST])
def test_intervals_can_be_asked_for(message_id: int, interval_us: int, way: int) -> None:
    stream = flying()
    ask(stream, SET, ATTITUDE, 10_000.0)
    asked = (message_id, 0.0) if way == GET else (mav.MAVLINK_MSG_ID_MESSAGE_INTERVAL, message_id)
    assert ask(stream, way, *asked) == ACCEPTED
    (send,) = stream.poll(0)
    (answer,) = on_the_wire([send])
    assert send.channel == GROUND.channel
    assert (answer.fields.message_id, answer.fields.interval_us) == (message_id, interval_us)


def test_the_interval_of_a_message_that_is_not_sent_is_0() -> None:
    stream = flying()
    assert ask(stream, GET, 246.0) == UNSUPPORTED
    assert [send.fields for send in stream.poll(0)] == [(246, 0)]


def test_a_message_comes_on_request_to_whoever_asks() -> None:
    stream = flying()
    assert ask(stream, REQUEST, HOME) == ACCEPTED
    assert ask(stream, REQUEST, 148, peer=OTHER) == ACCEPTED
    assert [(send.name, send.channel) for send in stream.poll(0)] == [("HOME_POSITION", 1), ("AUTOPILOT_VERSION", 2)]
    assert list(stream.poll(0)) == []


def test_what_is_not_known_yet_may_be_asked_for_later() -> None:
    stream = StreamService(TELEMETRY)
    assert ask(stream, REQUEST, ATTITUDE) == TEMPORARILY_REJECTED
    stream.update(TelemetrySnapshot(time_us=0))
    assert ask(stream, REQUEST, HOME) == TEMPORARILY_REJECTED
    stream.update(FLYING)
    assert ask(stream, REQUEST, HOME) == ACCEPTED


def test_a_provider_may_refuse() -> None:
    stream = flying()
    stream.provide("STORAGE_INFORMATION", lambda _: Refusal())
    assert ask(stream, REQUEST, mav.MAVLINK_MSG_ID_STORAGE_INFORMATION) == DENIED


@pytest.mark.parametrize(
    ("command", "result", "name"),
    [
        (520, ACCEPTED, "AUTOPILOT_VERSION"),
        (410, ACCEPTED, "HOME_POSITION"),
        (528, ACCEPTED, "FLIGHT_INFORMATION"),
        (525, UNSUPPORTED, None),
    ],
)
def test_older_requests_are_answered_alike(command: int, result: int, name: str | None) -> None:
    stream = flying()
    assert ask(stream, command, 1.0) == result
    assert [send.name for send in stream.poll(0)] == ([name] if name else [])


def test_requests_between_two_frames_have_a_limit() -> None:
    stream = flying()
    results = Counter(ask(stream, REQUEST, HOME) for _ in range(MAX_WAITING + 5))
    assert results == {ACCEPTED: MAX_WAITING, TEMPORARILY_REJECTED: 5}


@pytest.mark.parametrize("group", [0, *GROUPS])
def test_a_data_stream_is_a_group_of_messages(group: int) -> None:
    stream = flying()
    assert list(stream.receive(message("REQUEST_DATA_STREAM", 0, 0, group, 4, 1), GROUND, 0)) == []
    names = GROUPS[group] if group else [name for names in GROUPS.values() for name in names]
    told = counts(fly(stream, 0, 10_000_000))
    assert told.keys() == set(names)
    assert all(count == pytest.approx(40, abs=1) for count in told.values())
    stream.receive(message("REQUEST_DATA_STREAM", 0, 0, group, 4, 0), GROUND, 10_000_000)
    assert fly(stream, 10_000_000, 11_000_000) == []


def test_repeated_requests_do_not_delay_a_slow_stream() -> None:
    stream = flying()
    told: Counter[str] = Counter()
    for start_us in range(0, 10_000_000, 500_000):
        stream.receive(message("REQUEST_DATA_STREAM", 0, 0, 10, 1, 1), GROUND, start_us)
        told += counts(fly(stream, start_us, start_us + 500_000))
    assert told == {"ATTITUDE": 10, "ATTITUDE_QUATERNION": 10}


@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.lists(
        st.tuples(st.sampled_from([SET, GET, REQUEST, 520]), MESSAGE_IDS, FLOATS, PEERS)
        | st.tuples(st.integers(0, 255), st.integers(0, 65535), st.integers(0, 255), PEERS),
        max_size=30,
    )
)
def test_whatever_is_asked_nothing_raises(asked: list[tuple[Any, Any, Any, Peer]]) -> None:
    stream = flying(GCS)
    for number, (first, second, third, peer) in enumerate(asked):
        if isinstance(second, float):
            ask(stream, first, second, third, peer)
        else:
            fields = message("REQUEST_DATA_STREAM", 1, 1, first, second, third)
            list(stream.receive(fields, peer, number * FRAME_US))
        on_the_wire([send for send in stream.poll(number * FRAME_US) if send.fields])


def test_setting_intervals_without_end_takes_no_memory() -> None:
    stream = flying()
    for number in range(5_000):
        ask(stream, SET, ATTITUDE, 1e9 + 1000.0 * number)
    assert len(stream._schedule._heap) < 200  # noqa: SLF001
