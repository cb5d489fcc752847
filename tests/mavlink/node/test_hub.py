from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from colibri.mavlink.node import hub
from colibri.mavlink.node.channel import DATAGRAM_BYTES
from colibri.mavlink.node.hub import CHANNELS, FORGET_AFTER_US, SILENT_AFTER_US, Hub
from colibri.mavlink.node.service import Peer, Send, to_all
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.signing import Signing
from tests.support.hub_ends import (
    GCS,
    HEARTBEAT,
    SDK,
    CountedShell,
    Observer,
    Recorder,
    Station,
    frames_to,
    sent,
    typed,
)


@pytest.fixture
def service() -> Recorder:
    return Recorder()


@pytest.fixture
def ours(service: Recorder) -> Hub:
    return Hub(1, 1, [service])


def test_the_first_message_opens_a_channel(ours: Hub, service: Recorder) -> None:
    ours.receive(Station().says(), 2, GCS, 5)
    (channel,) = ours.channels
    assert (channel.link, channel.address, channel.sources, channel.received_us) == (2, GCS, ((255, 190),), 5)
    assert service.received == [("HEARTBEAT", Peer(channel.number, 255, 190), 5)]


def test_an_answer_takes_the_channel_that_the_question_came_on(ours: Hub) -> None:
    ours.receive(Station(245).says(), 1, SDK, 0)
    ours.receive(Station().says("PING", 1, 2, 0, 0), 0, GCS, 0)
    assert (0, GCS, ["PING"]) in sent(ours)
    ours.receive(Station(245).says("PING", 1, 2, 1, 1), 1, SDK, 0)
    assert sent(ours) == [(1, SDK, ["PING"])]


def test_a_broadcast_is_numbered_per_channel(ours: Hub) -> None:
    ours.open(0, GCS)
    ours.send([Send("PING", (1, 2, 0, 0), 0)])
    ours.open(1, SDK)
    ours.send([to_all("HEARTBEAT", *HEARTBEAT)])
    assert sent(ours) == [(0, GCS, ["PING", "HEARTBEAT"]), (1, SDK, ["HEARTBEAT"])]
    for _ in range(2):
        ours.send([to_all("HEARTBEAT", *HEARTBEAT)])
    numbers = [(out.datagram[4], out.datagram[21 + 4]) for out in ours.take_outbox()]
    assert numbers == [(2, 3), (1, 2)]


def test_nothing_is_sent_to_a_channel_that_is_no_more(ours: Hub) -> None:
    ours.send([Send("HEARTBEAT", HEARTBEAT, 99), to_all("HEARTBEAT", *HEARTBEAT)])
    assert ours.take_outbox() == []


def test_an_idle_service_is_polled_again_once_it_has_received() -> None:
    shell, recorder = CountedShell({}), Recorder()
    ours = Hub(1, 1, [shell, recorder])
    station = Station(255)
    ours.open(0, GCS)
    for now_us in range(0, 40_000, 4000):
        ours.poll(now_us)
    assert shell.polls == 1
    recorder.due = [to_all("HEARTBEAT", *HEARTBEAT)]
    ours.receive(station.says("SERIAL_CONTROL", *typed(b"help\n" * 20)), 0, GCS, 40_000)
    ours.poll(40_000)
    ((_, _, names),) = sent(ours)
    assert names == [*["SERIAL_CONTROL"] * (len(names) - 1), "HEARTBEAT"]  # in the order of the services
    for now_us in range(44_000, 80_000, 4000):
        ours.poll(now_us)
    assert len(names) > 1
    assert shell.polls == 3  # once before, once for the answer, once to find that nothing is left


def test_a_service_that_raises_as_it_receives_is_not_idle() -> None:
    shell = CountedShell({"fail": lambda _: str(1 // 0)})
    caught: list[tuple[str, Exception, str]] = []
    ours = Hub(1, 1, [shell], caught=lambda *what: caught.append(what))
    ours.poll(0)
    ours.receive(Station(255).says("SERIAL_CONTROL", *typed(b"help\nfail\n")), 0, GCS, 4000)
    ours.poll(4000)
    assert [instead for _, _, instead in caught] == ["SERIAL_CONTROL dropped"]
    assert shell.polls == 2


def test_many_frames_share_datagrams_and_keep_their_order(ours: Hub) -> None:
    ours.open(0, GCS)
    texts = [f"{i:050d}" for i in range(100)]
    ours.send([to_all("STATUSTEXT", 6, text, 0, 0) for text in texts])
    outbox = ours.take_outbox()
    assert max(len(out.datagram) for out in outbox) <= DATAGRAM_BYTES
    assert len(outbox) == 5
    theirs = common.MAVLink(None)
    received = [message.text for out in outbox for message in theirs.parse_buffer(out.datagram)]
    assert received == texts


@pytest.mark.parametrize(
    ("name", "fields", "obeyed"),
    [
        ("COMMAND_LONG", (1, 1, 400, 0, *[1.0] * 7), True),
        ("COMMAND_LONG", (2, 1, 400, 0, *[1.0] * 7), False),
        ("MANUAL_CONTROL", (2, 0, 0, 0, 0, 0), False),
        ("MANUAL_CONTROL", (1, 0, 0, 0, 0, 0), True),
    ],
)
def test_only_what_is_for_us_is_obeyed(
    ours: Hub, service: Recorder, name: str, fields: tuple[Any, ...], obeyed: bool
) -> None:
    ours.receive(Station().says(name, *fields), 0, GCS, 0)
    assert service.names == [name] * obeyed


def test_our_own_messages_are_not_heard_when_they_come_back(ours: Hub, service: Recorder) -> None:
    ours.open(0, GCS)
    ours.receive(Station(1, 1).says(), 0, GCS, 0)
    ours.receive(Station(1, 1).says(), 1, SDK, 0)
    assert service.received == []
    assert len(ours.channels) == 1
    assert ours.take_outbox() == []
    assert ours.dropped == {"echo": 2}


def test_messages_are_forwarded_byte_for_byte(ours: Hub, service: Recorder) -> None:
    gcs, sdk = Station(), Station(245)
    ours.receive(gcs.says(), 0, GCS, 0)
    ours.receive(sdk.says(), 0, SDK, 0)
    ours.take_outbox()
    service.received.clear()
    for datagram, received in (
        (gcs.says("COMMAND_LONG", 245, 190, 400, 0, *[1.0] * 7), False),
        (gcs.says("STATUSTEXT", 6, b"\xff\xfe", 0, 0), True),
        (gcs.says("FILE_TRANSFER_PROTOCOL", 0, 245, 0, range(251)), False),
    ):
        ours.receive(datagram, 0, GCS, 0)
        (out,) = ours.take_outbox()
        assert (out.address, out.datagram) == (SDK, datagram)
        assert bool(service.received) is received
        service.received.clear()


def unknown_frame() -> bytes:
    frame = bytearray(Station().says())
    frame[7:10] = b"\xff\xfe\xff"
    return bytes(frame)


def test_unknown_messages_are_forwarded_but_open_no_channel(ours: Hub, service: Recorder) -> None:
    ours.receive(unknown_frame(), 0, GCS, 0)
    assert ours.channels == ()
    assert ours.dropped == {"stranger": 1}
    ours.receive(Station().says(), 0, GCS, 0)
    ours.open(1, SDK)
    ours.take_outbox()
    ours.receive(unknown_frame(), 0, GCS, 0)
    assert frames_to(ours, SDK) == unknown_frame()
    assert service.names == ["HEARTBEAT"]


def test_what_is_lost_shows_in_the_gaps(ours: Hub) -> None:
    station = Station()
    frames = [station.says() for _ in range(300)]
    for i, frame in enumerate(frames):
        if i % 10 not in (3, 4):
            ours.receive(frame, 0, GCS, i)
    ours.receive(frames[-1], 0, GCS, 300)
    ours.receive(frames[-5], 0, GCS, 301)
    (channel,) = ours.channels
    assert (channel.lost, channel.received, channel.received_us) == (60, 242, 301)


def test_what_is_sent_and_dropped_is_counted_per_channel(ours: Hub) -> None:
    number = ours.open(0, GCS)
    ours.open(1, SDK)
    ours.receive(b"\xfd\x00", 0, GCS, 0)
    ours.send([Send("HEARTBEAT", HEARTBEAT, number)])
    gcs, sdk = ours.channels
    assert (gcs.received, gcs.sent, gcs.dropped, gcs.received_us) == (0, 1, 1, None)
    assert (sdk.sent, sdk.dropped) == (0, 0)
    assert ours.dropped == {"truncated": 1}


def test_a_fixed_channel_is_the_one_that_its_target_is_heard_on(ours: Hub) -> None:
    number = ours.open(0, GCS)
    assert ours.open(0, GCS) == number
    ours.receive(Station().says(), 0, GCS, 0)
    assert [channel.number for channel in ours.channels] == [number]


def test_a_fixed_channel_without_address_takes_its_whole_link(ours: Hub) -> None:
    number = ours.open(0, None)
    ours.receive(Station().says(), 0, GCS, 0)
    ours.receive(Station(245).says(), 0, SDK, 0)
    assert [(channel.number, channel.received) for channel in ours.channels] == [(number, 2)]


def test_of_too_many_channels_the_one_silent_longest_goes(service: Recorder) -> None:
    observer = Observer()
    ours = Hub(1, 1, [service], observers=[observer])
    fixed = ours.open(0, GCS)
    for i in range(1, CHANNELS):
        ours.receive(Station(i + 1).says(), 1, ("127.0.0.1", i), i)
    ours.receive(Station(2).says(), 1, ("127.0.0.1", 1), SILENT_AFTER_US)
    for i in range(CHANNELS, CHANNELS + 5):
        ours.receive(Station(i + 1).says(), 1, ("127.0.0.1", i), SILENT_AFTER_US + i)
    addresses = [channel.address for channel in ours.channels]
    assert len(addresses) == CHANNELS
    assert addresses[:2] == [GCS, ("127.0.0.1", 1)]
    assert ("127.0.0.1", 2) not in addresses
    assert ("127.0.0.1", 7) in addresses
    assert observer.open == [channel.number for channel in ours.channels]
    assert len(observer.told) == len(set(observer.told))
    assert ("closed", fixed) not in observer.told


def test_fixed_channels_leave_no_room(ours: Hub, service: Recorder) -> None:
    for i in range(CHANNELS):
        ours.open(0, ("127.0.0.1", i))
    ours.receive(Station().says(), 1, GCS, 0)
    assert service.received == []
    assert ours.dropped == {"no room": 1}


def test_a_silent_channel_is_forgotten_unless_it_is_fixed(ours: Hub) -> None:
    ours.open(0, GCS)
    ours.receive(Station().says(), 1, SDK, 0)
    ours.poll(FORGET_AFTER_US)
    assert len(ours.channels) == 2
    ours.poll(FORGET_AFTER_US + 2_000_000)
    assert [channel.address for channel in ours.channels] == [GCS]


def test_the_number_of_a_closed_channel_is_not_used_again(service: Recorder) -> None:
    observer = Observer()
    ours = Hub(1, 1, [service], observers=[observer])
    ours.open(0, GCS)
    ours.receive(Station().says(), 1, SDK, 0)
    ours.receive(b"\xfd", 1, SDK, 0)
    ours.close(1, SDK)
    ours.close(1, SDK)
    ours.close(1, GCS)
    assert [channel.address for channel in ours.channels] == [GCS]
    ours.receive(Station().says(), 1, SDK, 0)
    ours.close(0, GCS)
    assert observer.told == [("opened", 0), ("opened", 1), ("closed", 1), ("opened", 2), ("closed", 0)]
    assert ours.dropped == {"truncated": 1}


# Anything at all

NAMES = sorted(definition.msgname for definition in dialect.mav.mavlink_map.values())


def frame_of(name: str, payload: bytes, source: tuple[int, int], sequence: int) -> bytes:
    definition = getattr(dialect.mav, f"MAVLink_{name.lower()}_message")
    body = bytes([len(payload), 0, 0, sequence, *source]) + definition.id.to_bytes(3, "little") + payload
    crc: int = dialect.mav.x25crc(body + bytes([definition.crc_extra])).crc
    return b"".join((b"\xfd", body, bytes(divmod(crc, 256)[::-1])))


FRAMES = st.builds(
    frame_of,
    st.sampled_from(NAMES) | st.sampled_from(["SETUP_SIGNING", "PING", "PARAM_SET", "MANUAL_CONTROL"]),
    st.binary(min_size=1, max_size=255),
    st.tuples(st.integers(0, 255), st.integers(0, 255)),
    st.integers(0, 255),
)
DATAGRAMS = st.lists(FRAMES | st.binary(max_size=60), max_size=4).map(b"".join)
EVENTS = st.tuples(DATAGRAMS, st.integers(0, 2), st.none() | st.tuples(st.just("127.0.0.1"), st.integers(0, 50)),
                   st.integers(0, 10**10), st.booleans())  # fmt: skip


@given(st.lists(EVENTS, max_size=12), st.sampled_from([None, bytes(range(32))]))
def test_nothing_that_comes_raises(events: list[tuple[Any, ...]], key: bytes | None) -> None:
    observer = Observer()
    ours = Hub(1, 1, [Recorder()], signing=Signing(key, lambda: 3_600_000_000_000), observers=[observer])
    ours.open(0, GCS)
    for datagram, link, address, now_us, owner in events:
        ours.receive(datagram, link, address, now_us, owner=owner)
        ours.poll(now_us)
        for out in ours.take_outbox():
            assert 0 < len(out.datagram) <= DATAGRAM_BYTES
    assert len(ours.channels) <= CHANNELS
    assert observer.open == [channel.number for channel in ours.channels]


def test_a_flood_of_senders_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hub, "CHANNELS", 3)
    ours = Hub(1, 1, [])
    for i in range(500):
        ours.receive(Station(2 + i % 200).says(), 0, ("127.0.0.1", i), i)
        ours.take_outbox()
    assert [channel.number for channel in ours.channels] == [0, 1, 499]  # who speaks is not pushed out
    assert len(ours._numbers) == len(ours._sources) == 3  # noqa: SLF001
