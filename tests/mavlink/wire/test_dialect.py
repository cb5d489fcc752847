"""Bytes ⇄ messages: nothing malformed raises, nothing good is lost beside it."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Bits, Codec, param_bits

HEARTBEAT = (dialect.TYPE_QUADROTOR, dialect.AUTOPILOT_GENERIC, 0, 0, dialect.STATE_ACTIVE, 3)


def heartbeat(system_id: int = 7, component_id: int = 9) -> bytes:
    return Codec(system_id, component_id).encode("HEARTBEAT", *HEARTBEAT)


UNKNOWN = heartbeat()[:7] + b"\xff\xff\xff" + heartbeat()[10:]


def packed(message: Any, *, old: bool = False) -> bytes:
    """Return a frame of pymavlink's."""
    return bytes(message.pack(common.MAVLink(None, srcSystem=7, srcComponent=9), force_mavlink1=old))


def test_sequence_numbers_count_and_wrap() -> None:
    codec = Codec(1, 1)
    sequence = [codec.encode("HEARTBEAT", *HEARTBEAT)[4] for _ in range(257)]
    assert sequence == [*range(256), 0]


@given(st.binary(max_size=400))
def test_random_bytes_neither_raise_nor_hide_the_next_datagram(noise: bytes) -> None:
    codec = Codec(1, 1)
    codec.decode(noise)
    assert [message.name for message in codec.decode(heartbeat())] == ["HEARTBEAT"]


@given(st.integers(0, 20), st.integers(1, 255))
def test_one_flipped_byte_is_caught(position: int, flip: int) -> None:
    codec = Codec(1, 1)
    frame = bytearray(heartbeat())
    frame[position] ^= flip
    decoded = codec.decode(bytes(frame))
    assert decoded == []
    assert sum(codec.dropped.values()) >= 1


@pytest.mark.parametrize("length", range(1, 21))
def test_a_truncated_frame_is_counted(length: int) -> None:
    codec = Codec(1, 1)
    assert codec.decode(heartbeat()[:length]) == []
    assert codec.dropped == {"truncated": 1}


def test_an_unknown_message_is_counted() -> None:
    codec = Codec(1, 1)
    assert codec.decode(UNKNOWN) == []
    assert codec.dropped == {"unknown": 1}


def pymavlink_frame(name: str, payload: bytes) -> tuple[Any, bytes, list[Any]]:
    mav = common.MAVLink(None, srcSystem=7, srcComponent=9)
    definition = getattr(common, f"MAVLink_{name.lower()}_message")
    numbers = dict(zip(definition.ordered_fieldnames, unflattened(definition, payload), strict=True))
    fields = [numbers[field] for field in definition.fieldnames]
    frame = bytes(definition(*fields).pack(mav))
    (message,) = mav.parse_buffer(frame)
    return message, frame, fields


def unflattened(definition: Any, payload: bytes) -> list[Any]:
    flat = iter(definition.unpacker.unpack(payload))
    types = dict(zip(definition.fieldnames, definition.fieldtypes, strict=True))
    return [
        [next(flat) for _ in range(length)] if length and types[field] != "char" else next(flat)
        for field, length in zip(definition.ordered_fieldnames, definition.array_lengths, strict=True)
    ]


NAMES = sorted(definition.msgname for definition in common.mavlink_map.values())
WITH_TEXT = [name for name in NAMES if "char" in getattr(common, f"MAVLink_{name.lower()}_message").fieldtypes]


@settings(max_examples=200)
@given(st.data(), st.sampled_from(NAMES) | st.sampled_from(WITH_TEXT))
def test_reads_and_writes_as_pymavlink_does(data: st.DataObject, name: str) -> None:
    size = getattr(common, f"MAVLink_{name.lower()}_message").unpacker.size
    expected, frame, written = pymavlink_frame(name, data.draw(st.binary(min_size=size, max_size=size)))
    codec = Codec(7, 9)
    (message,) = codec.decode(frame)
    fields = [getattr(message.fields, field) for field in expected.get_fieldnames()]
    listed = [list(field) if isinstance(field, tuple) else field for field in fields]
    assert repr(listed) == repr([getattr(expected, field) for field in expected.get_fieldnames()])
    assert (message.name, message.source, message.frame) == (name, (7, 9), frame)
    assert codec.encode(name, *written) == frame
    if name not in WITH_TEXT:
        assert Codec(7, 9).encode(name, *fields) == frame


def test_text_may_be_a_str_and_is_cut_where_it_is_too_long() -> None:
    codec = Codec(7, 9)
    (message,) = codec.decode(codec.encode("PARAM_REQUEST_READ", 1, 1, "A_NAME_OF_MORE_THAN_16", -1))
    assert message.fields.param_id == "A_NAME_OF_MORE_T"
    assert message.fields.param_index == -1


SIGNALLING = [0x7F800001, 0x7FBFFFFF, 0xFF800001, 0xFFBFFFFF, -5000000 & 0xFFFFFFFF]
PATTERNS = st.integers(0, 0xFFFFFFFF) | st.integers(0x7F800001, 0x7FBFFFFF) | st.integers(0xFF800001, 0xFFBFFFFF)


@given(PATTERNS)
def test_every_bit_of_a_parameter_survives(pattern: int) -> None:
    codec = Codec(7, 9)
    for frame in (
        codec.encode("PARAM_VALUE", b"SYS_ID", Bits(pattern), 6, 3, 1),
        codec.encode("PARAM_SET", 1, 1, "SYS_ID", Bits(pattern), 6),
    ):
        (message,) = codec.decode(frame)
        assert param_bits(message) == pattern
        assert (message.fields.param_id, message.fields.param_type) == ("SYS_ID", 6)


@pytest.mark.parametrize("pattern", SIGNALLING)
def test_parameter_bits_are_read_in_place_by_other_software(pattern: int) -> None:
    frame = Codec(7, 9).encode("PARAM_SET", 1, 1, b"A", Bits(pattern), 6)
    assert int.from_bytes(frame[10:14], "little") == pattern


def test_a_parameter_may_still_be_a_float_and_come_in_mavlink_1() -> None:
    codec = Codec(7, 9)
    parameter = common.MAVLink_param_set_message(1, 1, b"A", 2.5, 9)
    assert codec.encode("PARAM_SET", 1, 1, b"A", 2.5, 9) == packed(parameter)
    (message,) = codec.decode(packed(parameter, old=True))
    assert param_bits(message) == 0x40200000


@given(st.binary(max_size=4))
def test_parameter_bits_survive_truncated_zeros(value: bytes) -> None:
    codec = Codec(7, 9)
    whole = value.ljust(4, b"\0")
    (message,) = codec.decode(codec.encode("PARAM_SET", 0, 0, b"", Bits(int.from_bytes(whole, "little")), 0))
    assert param_bits(message) == int.from_bytes(whole, "little")


def test_fields_of_an_extension_may_be_left_out() -> None:
    q = (1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3)
    expected = packed(common.MAVLink_attitude_quaternion_message(4, *q))
    assert Codec(7, 9).encode("ATTITUDE_QUATERNION", 4, *q) == expected


def test_text_and_mavlink_1_are_messages_too() -> None:
    codec = Codec(7, 9)
    text = codec.encode("STATUSTEXT", 6, b"hello")
    old = packed(common.MAVLink_heartbeat_message(*HEARTBEAT), old=True)
    names = [message.name for message in codec.decode(text + heartbeat() + old)]
    assert names == ["STATUSTEXT", "HEARTBEAT", "HEARTBEAT"]
    assert not codec.dropped


@given(st.lists(st.sampled_from(range(6)), max_size=5), st.binary(max_size=12))
def test_a_good_frame_among_noise_is_found(order: list[int], noise: bytes) -> None:
    parts = [heartbeat(), noise, heartbeat()[:-1], b"\xfd", b"\xfd\x00\xff", heartbeat()[:-1] + b"\0"]
    datagram = b"".join(parts[i] for i in order)
    fast, slow = Codec(1, 1), Codec(1, 1)
    decoded = [message.frame for message in fast.decode(datagram)]
    assert decoded == [message.frame for message in slow._parsed(datagram)]  # noqa: SLF001
    assert fast.dropped == slow.dropped


SIGNATURE = b"\x03" + bytes(range(12))


def sealed_heartbeat() -> bytes:
    codec = Codec(7, 9)
    codec.seal = lambda _: SIGNATURE
    return codec.encode("HEARTBEAT", *HEARTBEAT)


def test_the_signature_covers_the_whole_frame() -> None:
    codec, sealed = Codec(7, 9), []
    codec.seal = lambda frame: sealed.append(frame) or SIGNATURE  # type: ignore[func-returns-value]
    frame = codec.encode("HEARTBEAT", *HEARTBEAT)
    assert frame == sealed[0] + SIGNATURE
    assert frame[2] == dialect.SIGNED
    codec.seal = None
    assert codec.encode("HEARTBEAT", *HEARTBEAT)[2:5] == b"\0\0\1"


@pytest.mark.parametrize("beside", [b"", b"\xfd", b"\xfd\x00\xff"])
def test_signed_frames_are_read_with_their_signature(beside: bytes) -> None:
    signed = sealed_heartbeat()
    messages = Codec(1, 1).decode(heartbeat() + signed + signed + heartbeat() + beside)
    assert [message.frame for message in messages] == [heartbeat(), signed, signed, heartbeat()]


def test_an_unknown_message_is_kept_on_demand() -> None:
    codec = Codec(1, 1, keep_unknown=True)
    kept, known = codec.decode(UNKNOWN + heartbeat())
    assert (kept.name, kept.source, kept.fields, kept.frame) == (dialect.UNKNOWN, (7, 9), None, UNKNOWN)
    assert known.name == "HEARTBEAT"
    assert not codec.dropped


@pytest.mark.parametrize("old", [False, True])
def test_what_a_frame_tells_without_being_decoded(old: bool) -> None:
    mav = common.MAVLink(None, srcSystem=7, srcComponent=9)
    mav.seq = 77
    frame = bytes(common.MAVLink_heartbeat_message(*HEARTBEAT).pack(mav, force_mavlink1=old))
    assert dialect.sequence_of(frame) == 77
    assert dialect.payload(frame) == bytes([0, 0, 0, 0, *HEARTBEAT[:3], *HEARTBEAT[4:]])
    assert dialect.intact(frame) is True
    assert dialect.intact(frame[:-1] + bytes([frame[-1] ^ 1])) is False


def test_nobody_can_tell_whether_an_unknown_message_is_intact() -> None:
    assert dialect.intact(UNKNOWN) is None
    assert dialect.intact(sealed_heartbeat()) is True
