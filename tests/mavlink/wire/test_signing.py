"""Message signing, against pymavlink's in both directions."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from colibri.mavlink.wire import signing
from colibri.mavlink.wire.dialect import Codec
from colibri.mavlink.wire.signing import (
    AHEAD_TICKS,
    LAST_TICK,
    NEW_STREAM_TICKS,
    TOO_EARLY,
    Signing,
    SigningError,
    parse_key,
    read_key,
    tick_at,
)

KEY = bytes(range(32))
OTHER_KEY = bytes(range(1, 33))
START = 3_600_000_000_000
HEARTBEAT = (6, 8, 0, 0, 4, 3)


def pymavlink(key: bytes | None = KEY, *, timestamp: int = START, system: int = 255, link_id: int = 5) -> Any:
    mav = common.MAVLink(None, srcSystem=system, srcComponent=190)
    mav.robust_parsing = True
    if key is not None:
        mav.signing.secret_key = key
        mav.signing.sign_outgoing = True
        mav.signing.timestamp = timestamp
        mav.signing.link_id = link_id
    return mav


def heartbeat(mav: Any) -> bytes:
    return bytes(common.MAVLink_heartbeat_message(*HEARTBEAT).pack(mav))


class Clock:
    """A wall clock that is set by hand, in ticks."""

    def __init__(self, now: int = START) -> None:
        self.now = now

    def __call__(self) -> int:
        return self.now


def sealed(ours: Signing, link_id: int = 3) -> Codec:
    codec = Codec(1, 1)
    codec.seal = lambda frame: ours.sign(frame, link_id)
    return codec


def refusal(ours: Signing, frame: bytes) -> str | None:
    (message,) = Codec(1, 1).decode(frame)
    assert message.frame == frame
    return ours.refusal(message.name, message.frame)


@given(st.binary(min_size=32, max_size=32).filter(any), st.integers(0, 255), st.integers(0, 10**8))
def test_pymavlink_believes_what_we_sign(key: bytes, link_id: int, ticks: int) -> None:
    theirs = pymavlink(key)
    codec = sealed(Signing(key, Clock(START + ticks)), link_id)
    for name, fields in (("HEARTBEAT", HEARTBEAT), ("STATUSTEXT", (6, "hello", 0, 0))):
        (message,) = theirs.parse_buffer(codec.encode(name, *fields))
        assert message.get_type() == name
        assert message.get_signed()
        assert message.get_link_id() == link_id
    assert theirs.signing.timestamp == START + ticks + 2


@given(st.binary(min_size=32, max_size=32).filter(any), st.integers(0, 255))
def test_we_believe_what_pymavlink_signs(key: bytes, link_id: int) -> None:
    ours, theirs = Signing(key, Clock()), pymavlink(key, link_id=link_id)
    for _ in range(3):
        assert refusal(ours, heartbeat(theirs)) is None
    assert ours.timestamp == START + 2


def test_neither_believes_another_key() -> None:
    ours, theirs = Signing(KEY, Clock()), pymavlink(OTHER_KEY)
    assert refusal(ours, heartbeat(theirs)) == "bad signature"
    (message,) = theirs.parse_buffer(sealed(ours).encode("HEARTBEAT", *HEARTBEAT))
    assert message.get_type() == "BAD_DATA"


@pytest.mark.parametrize("position", [4, 5, 6, -15, -13, -12, -7, -6, -1])
def test_no_byte_may_be_changed(position: int) -> None:
    ours = Signing(KEY, Clock())
    frame = bytearray(heartbeat(pymavlink()))
    frame[position] ^= 1
    assert ours.refusal("HEARTBEAT", bytes(frame)) == "bad signature"
    assert ours.timestamp == START
    assert refusal(ours, heartbeat(pymavlink())) is None


def test_unsigned_messages_are_refused_but_for_those_of_radios() -> None:
    ours, theirs = Signing(KEY, Clock()), pymavlink(None)
    assert refusal(ours, heartbeat(theirs)) == "unsigned"
    old = bytes(common.MAVLink_heartbeat_message(*HEARTBEAT).pack(theirs, force_mavlink1=True))
    assert refusal(ours, old) == "unsigned"
    radio = bytes(common.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7).pack(theirs))
    assert refusal(ours, radio) is None
    forged = bytes(common.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7).pack(pymavlink(OTHER_KEY)))
    assert refusal(ours, forged) == "bad signature"


def test_without_a_key_everything_is_believed() -> None:
    ours = Signing(None, Clock())
    assert not ours.active
    assert refusal(ours, heartbeat(pymavlink(None))) is None
    assert refusal(ours, heartbeat(pymavlink(OTHER_KEY))) is None
    assert ours.timestamp == START


def test_a_replay_is_refused() -> None:
    ours, theirs = Signing(KEY, Clock()), pymavlink()
    first, second = heartbeat(theirs), heartbeat(theirs)
    assert refusal(ours, second) is None
    assert refusal(ours, second) == "replayed"
    assert refusal(ours, first) == "replayed"


def test_streams_are_told_apart_by_system_and_link() -> None:
    ours = Signing(KEY, Clock())
    for theirs in (pymavlink(), pymavlink(system=254), pymavlink(link_id=6)):
        assert refusal(ours, heartbeat(theirs)) is None


@pytest.mark.parametrize(
    ("behind", "expected"), [(NEW_STREAM_TICKS, None), (NEW_STREAM_TICKS + 1, "replayed"), (START, "replayed")]
)
def test_a_new_stream_may_be_a_minute_behind(behind: int, expected: str | None) -> None:
    assert refusal(Signing(KEY, Clock()), heartbeat(pymavlink(timestamp=START - behind))) == expected


def test_a_stream_that_is_known_may_be_further_behind() -> None:
    clock, slow = Clock(), pymavlink()
    ours = Signing(KEY, clock)
    assert refusal(ours, heartbeat(slow)) is None
    clock.now += 360_000_000
    assert refusal(ours, heartbeat(slow)) is None
    assert refusal(ours, heartbeat(pymavlink(link_id=6))) == "replayed"


def test_the_timestamp_never_goes_back() -> None:
    clock = Clock(START + 100)
    ours = Signing(KEY, clock)
    codec = sealed(ours)
    codec.encode("HEARTBEAT", *HEARTBEAT)
    codec.encode("HEARTBEAT", *HEARTBEAT)
    assert ours.timestamp == START + 102
    assert refusal(ours, heartbeat(pymavlink(timestamp=START + 5000))) is None
    assert ours.timestamp == START + 5000
    assert refusal(ours, heartbeat(pymavlink(timestamp=START + 200, link_id=9))) is None
    assert ours.timestamp == START + 5000
    clock.now = START
    codec.encode("HEARTBEAT", *HEARTBEAT)
    assert ours.timestamp == START + 5001


def test_a_timestamp_stored_continues_at_the_next_start() -> None:
    clock = Clock()
    before, old = Signing(KEY, clock), heartbeat(pymavlink())
    assert refusal(before, old) is None
    clock.now += 12_000_000
    sealed(before).encode("HEARTBEAT", *HEARTBEAT)
    clock.now -= 4_000_000
    after = Signing(KEY, clock, before.timestamp)
    assert after.timestamp == before.timestamp
    assert refusal(after, old) == "replayed"


@pytest.mark.parametrize(("ahead", "expected"), [
    (AHEAD_TICKS, None),
    (AHEAD_TICKS + 1, TOO_EARLY),
    (tick_at(4.2e9) - START, TOO_EARLY),  # 2103
    (LAST_TICK - START, TOO_EARLY),
])  # fmt: skip
def test_a_stamp_from_the_future_locks_nobody_out(ahead: int, expected: str | None) -> None:
    clock = Clock()
    ours, early = Signing(KEY, clock), heartbeat(pymavlink(timestamp=START + ahead, link_id=7))
    assert refusal(ours, early) == expected
    assert ours.set_up(KEY, START + ahead) is (expected is None)
    assert refusal(ours, heartbeat(pymavlink(timestamp=START - AHEAD_TICKS))) is None
    stored = Signing(KEY, clock, START + ahead)  # by an earlier version, or before the clock was set back
    assert refusal(stored, heartbeat(pymavlink(timestamp=START - AHEAD_TICKS))) is None
    assert stored.timestamp == START + ahead


@pytest.mark.parametrize(("mode", "said"), [(0o600, ""), (0o644, "mode 0644"), (0o640, "mode 0640")])
def test_a_key_that_others_read_is_taken_with_a_warning(tmp_path: Path, mode: int, said: str) -> None:
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(mode)
    key, warning = read_key(path)
    assert key == KEY
    assert warning.startswith(said)
    assert bool(warning) is bool(said)


def test_a_key_that_others_write_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(0o666)
    with pytest.raises(SigningError, match=r"writable by everyone \(mode 0666\)"):
        read_key(path)


def test_streams_are_forgotten_without_opening_a_door_to_replays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signing, "STREAMS", 4)
    ours = Signing(KEY, Clock())
    frames = [heartbeat(pymavlink(timestamp=START + i, link_id=i)) for i in range(10)]
    assert [refusal(ours, frame) for frame in frames] == [None] * 10
    assert [refusal(ours, frame) for frame in frames] == ["replayed"] * 10
    assert refusal(ours, heartbeat(pymavlink(timestamp=START + 6, link_id=1))) is None


def test_setting_up_changes_the_key_and_zeros_end_signing() -> None:
    ours = Signing(None, Clock())
    assert ours.set_up(KEY, START + 1000)
    assert (ours.active, ours.key, ours.key_changed) == (True, KEY, True)
    assert refusal(ours, heartbeat(pymavlink(timestamp=START + 1000))) is None
    assert refusal(ours, heartbeat(pymavlink(timestamp=START + 1000 - NEW_STREAM_TICKS - 1, link_id=9))) == "replayed"
    assert ours.set_up(bytes(32), 0)
    assert (ours.active, ours.key) == (False, None)
    assert ours.timestamp >= START + 1000


def test_a_key_that_comes_back_does_not_bring_its_frames_back() -> None:
    ours, frame = Signing(KEY, Clock()), heartbeat(pymavlink())
    assert refusal(ours, frame) is None
    ours.set_up(OTHER_KEY, 0)
    ours.set_up(KEY, 0)
    assert refusal(ours, frame) == "replayed"


@pytest.mark.parametrize("initial", [-1, START + AHEAD_TICKS + 1, LAST_TICK, 2**64 - 1])
def test_a_timestamp_that_cannot_be_is_not_set_up(initial: int) -> None:
    ours = Signing(KEY, Clock())
    assert not ours.set_up(OTHER_KEY, initial)
    assert not ours.set_up(b"short", START)
    assert (ours.key, ours.timestamp, ours.key_changed) == (KEY, START, False)


@pytest.mark.parametrize("stored", [-5, 0, LAST_TICK - 1, LAST_TICK, LAST_TICK + 1, 2**64])
def test_the_ends_of_time_raise_nothing(stored: int) -> None:
    clock = Clock(0)
    ours = Signing(KEY, clock, stored)
    for clock.now in (0, 10**12, LAST_TICK):
        sealed(ours).encode("HEARTBEAT", *HEARTBEAT)
        refusal(ours, heartbeat(pymavlink(timestamp=LAST_TICK)))
    assert ours.timestamp == LAST_TICK


@pytest.mark.parametrize("content", [KEY, KEY.hex().encode(), b" " + KEY.hex().upper().encode() + b"\r\n"])
def test_a_key_is_bytes_or_digits(content: bytes) -> None:
    assert parse_key(content) == KEY


@pytest.mark.parametrize(
    "content", [b"", KEY[:31], KEY + b"\n", KEY.hex().encode()[:-1], b"g" * 64, b"\xff" * 64, bytes(32), b"0" * 64]
)
def test_what_is_no_key_is_refused(content: bytes) -> None:
    with pytest.raises(SigningError, match=r"expected 32 bytes or 64 hexadecimal digits, found \d+ bytes|zeros"):
        parse_key(content)


def test_ticks_count_from_2015() -> None:
    assert tick_at(1_420_070_400.0) == 0
    assert tick_at(1_420_070_401.5) == 150_000
    assert tick_at(0.0) == 0
    assert tick_at(1e30) == LAST_TICK
