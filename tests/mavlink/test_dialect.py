"""Bytes ⇄ messages: nothing malformed raises, nothing good is lost beside it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink import dialect
from mavlink.dialect import Codec

HEARTBEAT = (dialect.TYPE_QUADROTOR, dialect.AUTOPILOT_GENERIC, 0, 0, dialect.STATE_ACTIVE, 3)


def heartbeat(system_id: int = 7, component_id: int = 9) -> bytes:
    return Codec(system_id, component_id).encode("HEARTBEAT", *HEARTBEAT)


def test_speaks_mavlink_2_as_the_component_it_is() -> None:
    (message,) = Codec(1, 1).decode(heartbeat())
    assert message.frame[0] == 0xFD
    assert message.name == "HEARTBEAT"
    assert message.source == (7, 9)
    assert message.fields.type == dialect.TYPE_QUADROTOR


def test_sequence_numbers_count_and_wrap() -> None:
    codec = Codec(1, 1)
    sequence = [codec.encode("HEARTBEAT", *HEARTBEAT)[4] for _ in range(257)]
    assert sequence == [*range(256), 0]


def test_several_frames_in_one_datagram() -> None:
    assert [message.source for message in Codec(1, 1).decode(heartbeat(1) + heartbeat(2))] == [(1, 9), (2, 9)]


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
    unknown_id = bytearray(heartbeat())
    unknown_id[7:10] = b"\xff\xff\xff"
    assert codec.decode(bytes(unknown_id)) == []
    assert codec.dropped == {"unknown": 1}
