"""Whole frames out of a stream, wherever it is cut and whatever stands between them."""

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from colibri.mavlink.wire.dialect import Codec
from colibri.mavlink.wire.framing import Framer


def signed_heartbeat() -> bytes:
    codec = Codec(255, 190)
    codec.seal = lambda _: b"\xfd" * 13
    return codec.encode("HEARTBEAT", 2, 3, 0, 0, 4, 3)


def old_heartbeat() -> bytes:
    mav = common.MAVLink(None, srcSystem=7, srcComponent=9)
    return bytes(common.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3).pack(mav, force_mavlink1=True))


def unknown() -> bytes:
    frame = bytearray(Codec(7, 9).encode("HEARTBEAT", 2, 3, 0, 0, 4, 3))
    frame[7:10] = b"\xff\xfe\xff"
    return bytes(frame)


FRAMES = [
    Codec(1, 1).encode("HEARTBEAT", 2, 3, 0, 0, 4, 3),
    Codec(1, 1).encode("STATUSTEXT", 6, b"\xfd\xfe\xfd\x00\x00", 0, 0),
    Codec(1, 1).encode("FILE_TRANSFER_PROTOCOL", 0, 1, 1, [0xFD] * 251),
    signed_heartbeat(),
    old_heartbeat(),
    unknown(),
]
MAX_FRAME_BYTES = 12 + 255 + 13
HARMLESS = st.binary(max_size=20).map(lambda noise: noise.replace(b"\xfd", b"").replace(b"\xfe", b""))


def chunks(stream: bytes, cuts: list[int]) -> list[bytes]:
    ends = sorted(cut % (len(stream) + 1) for cut in cuts)
    return [stream[a:b] for a, b in zip([0, *ends], [*ends, len(stream)], strict=True)]


@given(st.lists(st.sampled_from(FRAMES), max_size=8), st.lists(st.integers(0, 3000), max_size=12))
def test_frames_come_out_whole_wherever_the_stream_is_cut(frames: list[bytes], cuts: list[int]) -> None:
    framer = Framer()
    assert [frame for chunk in chunks(b"".join(frames), cuts) for frame in framer.take(chunk)] == frames


@given(
    st.lists(st.tuples(HARMLESS, st.sampled_from(FRAMES[:5])), max_size=5), st.lists(st.integers(0, 3000), max_size=9)
)
def test_what_stands_between_frames_is_skipped(parts: list[tuple[bytes, bytes]], cuts: list[int]) -> None:
    framer = Framer()
    stream = b"".join(noise + frame for noise, frame in parts)
    assert [frame for chunk in chunks(stream, cuts) for frame in framer.take(chunk)] == [frame for _, frame in parts]


@given(st.binary(max_size=300))
def test_noise_hides_frames_for_no_longer_than_a_frame_lasts(noise: bytes) -> None:
    framer = Framer()
    framer.take(noise)
    heartbeat = FRAMES[0]
    found = [frame for _ in range(40) for frame in framer.take(heartbeat)]
    assert found.count(heartbeat) >= 40 - MAX_FRAME_BYTES // len(heartbeat) - 1


def test_a_bad_checksum_does_not_drop_the_next_frame() -> None:
    broken = FRAMES[0][:-1] + bytes([FRAMES[0][-1] ^ 1])
    framer = Framer()
    assert framer.take(broken + FRAMES[1]) == [FRAMES[1]]


def test_an_unknown_flag_of_incompatibility_is_no_frame() -> None:
    frame = bytearray(FRAMES[0])
    frame[2] = 2
    framer = Framer()
    assert framer.take(bytes(frame)) == []
    assert framer.take(FRAMES[0]) == [FRAMES[0]]


@given(st.lists(st.binary(max_size=600), max_size=10))
def test_never_keeps_more_than_a_frame(stream: list[bytes]) -> None:
    framer = Framer()
    for chunk in stream:
        framer.take(chunk)
        assert len(framer._rest) < MAX_FRAME_BYTES  # noqa: SLF001
