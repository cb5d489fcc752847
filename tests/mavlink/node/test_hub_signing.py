from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from colibri.mavlink.node.hub import FUTURE, KEY_REFUSED, WARN_EVERY_US, Hub
from colibri.mavlink.node.service import to_all
from colibri.mavlink.wire.signing import AHEAD_TICKS, TOO_EARLY, Signing
from tests.support.hub_ends import GCS, HEARTBEAT, SDK, Recorder, Station, frames_to

KEY = bytes(range(32))
START = 3_600_000_000_000


def now() -> int:
    return START


@pytest.fixture
def service() -> Recorder:
    return Recorder()


def signed(system: int = 255, key: bytes = KEY, timestamp: int = START) -> Any:
    mav = common.MAVLink(None, srcSystem=system, srcComponent=190)
    mav.robust_parsing = True
    mav.signing.secret_key = key
    mav.signing.sign_outgoing = True
    mav.signing.timestamp = timestamp
    return mav


def packed(mav: Any, name: str = "heartbeat", *fields: Any) -> bytes:
    return bytes(getattr(common, f"MAVLink_{name}_message")(*(fields or HEARTBEAT)).pack(mav))


def test_signed_traffic_both_ways(service: Recorder) -> None:
    ours, theirs = Hub(1, 1, [service], signing=Signing(KEY, now)), signed()
    ours.receive(packed(theirs), 0, GCS, 0)
    ours.receive(packed(theirs, "ping", 1, 2, 0, 0), 0, GCS, 0)
    assert service.names == ["HEARTBEAT", "PING"]
    (message,) = theirs.parse_buffer(frames_to(ours, GCS))
    assert (message.get_type(), message.get_signed(), message.get_link_id()) == ("PING", True, 0)
    assert not ours.dropped


def test_unsigned_wrong_and_repeated_messages_change_nothing(service: Recorder) -> None:
    ours = Hub(1, 1, [service], signing=Signing(KEY, now))
    ours.receive(Station().says(), 0, GCS, 0)
    ours.receive(packed(signed(key=b"x" * 32)), 0, GCS, 0)
    ours.receive(packed(signed(timestamp=0)), 0, GCS, 0)
    radio = packed(common.MAVLink(None, srcSystem=51), "radio_status", 1, 2, 3, 4, 5, 6, 7)
    ours.receive(radio, 0, GCS, 0)
    assert (service.received, ours.channels) == ([], ())
    good = packed(signed())
    ours.receive(good + good, 0, GCS, 0)
    ours.receive(radio, 0, GCS, 0)
    assert service.names == ["HEARTBEAT", "RADIO_STATUS"]
    assert ours.dropped == {"unsigned": 1, "bad signature": 1, "replayed": 2, "stranger": 1}


def setup(key: bytes = KEY, target: tuple[int, int] = (1, 1), initial: int = START) -> bytes:
    return Station().says("SETUP_SIGNING", *target, list(key), initial)


def test_signing_is_set_up_by_the_owner_and_told_to_nobody(service: Recorder) -> None:
    ours = Hub(1, 1, [service], signing=Signing(None, now))
    ours.receive(Station(245).says(), 0, SDK, 0)
    ours.receive(setup(), 0, GCS, 0)
    assert ours.take_outbox() == []
    assert service.names == ["HEARTBEAT"]
    ours.send([to_all("HEARTBEAT", *HEARTBEAT)])
    theirs = signed()
    assert [theirs.parse_buffer(out.datagram)[0].get_signed() for out in ours.take_outbox()] == [True, True]
    ours.receive(Station().says(), 0, GCS, 0)
    assert ours.dropped == {"unsigned": 1}
    ours.receive(packed(theirs, "setup_signing", 1, 1, [0] * 32, 0), 0, GCS, 0)
    ours.send([to_all("HEARTBEAT", *HEARTBEAT)])
    assert [out.datagram[2] for out in ours.take_outbox()] == [0, 0]
    ours.receive(Station().says(), 0, GCS, 0)
    assert service.names == ["HEARTBEAT"] * 2


@pytest.mark.parametrize("target", [(0, 0), (2, 1), (1, 7), (0, 1)])
def test_signing_setup_is_addressed_to_us_by_the_owner_in_time(target: tuple[int, int]) -> None:
    signing = Signing(None, now)
    ours = Hub(1, 1, [], signing=signing)
    ours.receive(Station(2).says(), 0, SDK, 0)
    ours.take_outbox()
    ours.receive(setup(target=target), 0, GCS, 0)
    assert ours.take_outbox() == []
    before = ours.dropped["signing not set up"]
    ours.receive(setup(), 0, GCS, 0, owner=False)
    ours.receive(setup(initial=2**64 - 1), 0, GCS, 0)
    assert not signing.active
    assert ours.dropped == {"signing not set up": before + 2}


def test_a_new_key_must_be_signed_with_the_old_one(service: Recorder) -> None:
    signing = Signing(KEY, now)
    ours = Hub(1, 1, [service], signing=signing)
    ours.receive(setup(b"x" * 32), 0, GCS, 0)
    assert signing.key == KEY
    ours.receive(packed(signed(), "setup_signing", 1, 0, list(b"x" * 32), START), 0, GCS, 0)
    assert signing.key == b"x" * 32


def test_refused_keys_and_stamps_are_reported_once_in_a_while() -> None:
    said: list[str] = []
    ours = Hub(1, 1, [], signing=Signing(None, now), warn=said.append)
    for now_us in (0, 1, WARN_EVERY_US - 1, WARN_EVERY_US):
        ours.receive(setup(), 0, GCS, now_us, owner=False)
    assert said == [KEY_REFUSED] * 2
    ours = Hub(1, 1, [], signing=Signing(KEY, now), warn=said.append)
    ours.receive(packed(signed(timestamp=START + AHEAD_TICKS + 1)), 0, GCS, 0)
    assert said[2:] == [FUTURE]
    assert ours.dropped == {TOO_EARLY: 1}
