"""Frames of one length: the bytes and the numbers that the codec has for the same message, and nothing else."""

from collections.abc import Callable
from math import inf, nan
from random import Random
from typing import Any, NamedTuple

import pytest

from colibri.mavlink.wire.dialect import PLANT_COMPONENT, Codec
from colibri.mavlink.wire.fixed_frames import FixedFrame

SOURCE = (7, PLANT_COMPONENT)
FLOATS = (0.0, -0.0, 1.0, 1e-45, 3.4028234e38, nan, inf, -inf, 0.1, -273.15)


class Case(NamedTuple):
    name: str
    layout: FixedFrame
    numbers: Callable[[Random], tuple[Any, ...]]
    fields: Callable[..., tuple[Any, ...]]


def floats(random: Random, count: int) -> list[float]:
    return [random.choice(FLOATS) if random.random() < 0.2 else random.gauss(0.0, 1.0) for _ in range(count)]


def whole(random: Random, bits: int) -> int:
    return random.choice([0, 1, (1 << bits) - 1, random.getrandbits(bits)])


CASES = (
    Case(
        "LOCAL_POSITION_NED",
        FixedFrame("LOCAL_POSITION_NED", "time_boot_ms x y z vx vy vz"),
        lambda random: (whole(random, 32), *floats(random, 6)),
        lambda *numbers: numbers,
    ),
    Case(
        "HIL_ACTUATOR_CONTROLS",
        FixedFrame("HIL_ACTUATOR_CONTROLS", "time_usec flags controls[4] mode"),
        lambda random: (whole(random, 64), whole(random, 64), *floats(random, 4), whole(random, 8)),
        lambda time_us, flags, *rest: (time_us, (*rest[:4], *[0.0] * 12), rest[4], flags),
    ),
    Case(
        "ATTITUDE_QUATERNION",
        FixedFrame("ATTITUDE_QUATERNION", "time_boot_ms q1 q2 q3 q4 rollspeed pitchspeed yawspeed"),
        lambda random: (whole(random, 32), *floats(random, 7)),
        lambda *numbers: numbers,
    ),
    Case(
        "SYS_STATUS",
        FixedFrame("SYS_STATUS", "onboard_control_sensors_present onboard_control_sensors_enabled:H"),
        lambda random: (whole(random, 32), whole(random, 16)),
        lambda present, enabled: (present, enabled, *[0] * 11),
    ),
)
each = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])


@each
@pytest.mark.parametrize("seal", [None, lambda frame: frame[-13:]], ids=["unsigned", "signed"])
def test_the_bytes_are_those_of_the_codec(case: Case, seal: Callable[[bytes], bytes] | None) -> None:
    random, quick, codec = Random(1), Codec(*SOURCE), Codec(*SOURCE)
    quick.seal = codec.seal = seal
    for _ in range(600):
        numbers = case.numbers(random)
        assert case.layout.encode(quick, numbers) == codec.encode(case.name, *case.fields(*numbers))


@each
def test_numbers_are_read_where_the_codec_reads_the_same(case: Case) -> None:
    random, codec = Random(2), Codec(*SOURCE)
    read = 0
    for _ in range(600):
        frame = case.layout.encode(codec, case.numbers(random))
        if random.random() < 0.5:
            at = random.randrange(len(frame))
            frame = frame[:at] + bytes([frame[at] ^ 1 << random.randrange(8)]) + frame[at + 1 :]
        numbers = case.layout.read(b"before" + frame, 6, bytes(SOURCE)) if len(frame) == case.layout.size else None
        if numbers is not None:
            read += 1
            (message,) = codec.decode(frame)
            assert (message.name, message.source) == (case.name, SOURCE)
            fields = case.fields(*numbers)
            assert repr(fields) == repr(tuple(message.fields)[: len(fields)])
    assert read > 100


def test_a_layout_that_the_dialect_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match="the dialect has flags in place of controls"):
        FixedFrame("HIL_ACTUATOR_CONTROLS", "time_usec controls[16] mode flags")
