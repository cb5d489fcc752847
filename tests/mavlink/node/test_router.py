import pytest

from colibri.mavlink.node.channel import SOURCES, Channel
from colibri.mavlink.node.router import Source, concerns, onward, target_of
from colibri.mavlink.wire.dialect import MARKER, Codec, Message

OWN = (1, 1)
Received = dict[int, dict[Source, int]]
GCS, SDK, CAMERA, OTHER, GIMBAL = (255, 190), (245, 190), (1, 100), (2, 1), (2, 154)


@pytest.fixture
def received() -> Received:
    """A ground station on 0; an SDK on 1; our camera on 2; another vehicle with a gimbal on 3; silence on 4."""
    return {0: {GCS: 0}, 1: {SDK: 0}, 2: {CAMERA: 0}, 3: {OTHER: 0, GIMBAL: 0}, 4: {}}


@pytest.mark.parametrize(
    ("source", "channel", "target", "others"),
    [
        (GCS, 0, (0, 0), [1, 2, 3, 4]),
        (CAMERA, 2, (0, 0), [0, 1, 3, 4]),
        (GCS, 0, (0, 154), [1, 2, 3, 4]),
        (GCS, 0, OWN, []),
        (GCS, 0, (1, 0), [2]),
        (GCS, 0, CAMERA, [2]),
        (GCS, 0, OTHER, [3]),
        (GCS, 0, GIMBAL, [3]),
        (GCS, 0, (2, 0), [3]),
        (GCS, 0, (2, 7), []),
        (GCS, 0, (1, 7), []),
        (GCS, 0, (9, 1), []),
        (OTHER, 3, GIMBAL, []),
        (OTHER, 3, SDK, [1]),
        (GCS, 0, GCS, []),
        (GCS, 4, (0, 0), [1, 2, 3]),
    ],
)
def test_where_a_message_goes(
    received: Received, source: Source, channel: int, target: Source, others: list[int]
) -> None:
    assert onward(received, source, target, channel) == others


@pytest.mark.parametrize(
    ("target", "ours"),
    [((0, 0), True), (OWN, True), ((1, 0), True), ((0, 1), True), ((1, 2), False), ((2, 1), False), ((2, 0), False),
     ((0, 2), False)],
)  # fmt: skip
def test_what_concerns_us(target: Source, ours: bool) -> None:
    assert concerns(OWN, target) is ours


def test_a_target_on_two_channels_is_reached_on_both(received: Received) -> None:
    received[4][OTHER] = 0
    assert onward(received, GCS, OTHER, 0) == [3, 4]
    assert onward(received, GCS, (2, 0), 0) == [3, 4]


def test_nothing_runs_in_circles(received: Received) -> None:
    received[4][GCS] = 0
    assert onward(received, GCS, (0, 0), 0) == [1, 2, 3]
    assert onward(received, GCS, (0, 0), 4) == [1, 2, 3]


def test_the_table_is_bounded_per_channel(received: Received) -> None:
    channel = Channel(4, 0, None, Codec(*OWN), 0)
    for system in range(10, 10 + 2 * SOURCES):
        channel.receive(Message("HEARTBEAT", (system, 1), None, bytes((MARKER, 0, 0, 0, 0))), 0)
    received[4] = channel.sources_us
    reachable = [system for system in range(1, 256) if 4 in onward(received, GCS, (system, 1), 0)]
    assert reachable == list(range(10 + SOURCES, 10 + 2 * SOURCES))
    assert onward(received, GCS, OTHER, 0) == [3]


@pytest.mark.parametrize(
    ("name", "fields", "target"),
    [
        ("HEARTBEAT", (6, 8, 0, 0, 4, 3), (0, 0)),
        ("COMMAND_LONG", (1, 2, 400, 0, *[0.0] * 7), (1, 2)),
        ("SET_MODE", (3, 0, 0), (3, 0)),
        ("MANUAL_CONTROL", (4, 0, 0, 0, 0, 0), (4, 0)),
        ("PARAM_REQUEST_LIST", (5, 6), (5, 6)),
    ],
)
def test_whom_a_message_is_for(name: str, fields: tuple[int, ...], target: Source) -> None:
    codec = Codec(255, 190)
    (message,) = codec.decode(codec.encode(name, *fields))
    assert target_of(message.fields) == target


def test_a_message_without_fields_is_for_all() -> None:
    assert target_of(None) == (0, 0)
