"""The log of a flight by its own reader: every bit, from a file as from memory; and what is left of a damaged file."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.process.shared_log import SharedLog
from colibri.common.types import Array
from colibri.mavlink.ulog import messages
from colibri.mavlink.ulog.flight_topics import DECISION, FLIGHT_TOPICS, TRUTH, Topic
from colibri.mavlink.ulog.inputs import CHUNK_BYTES, InputRecord, RecordKind, encode_input
from colibri.mavlink.ulog.log import FileLog, MemoryLog, TopicLog, TopicReader, beginning
from colibri.mavlink.ulog.reader import FlightFile, LogFormatError

BEGINNING = beginning("Test", {})
ROWS = 150


def rows_of(topic: Topic, count: int = ROWS) -> Array:
    rows = np.random.default_rng(topic.number).integers(0, 100, (count, len(topic.names))).astype(float)
    rows[:, 0] = np.arange(count) * 4000 / 1e6
    if topic is TRUTH:
        rows[:, 1:] += 0.1
    return rows


def fill(log: TopicLog) -> None:
    for number in range(ROWS):
        for topic in FLIGHT_TOPICS:
            _, *numbers = rows_of(topic)[number].tolist()
            log.add(topic, (4000 * number, *(int(each) if each.is_integer() else each for each in numbers)))
    log.append(encode_input(0, RecordKind.SETUP, b"{}"))
    log.close()


def found(log: TopicReader, topic: Topic) -> Array:
    return np.concatenate([np.empty((0, len(topic.names))), *log.blocks(topic)])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    log = tmp_path / "flight.ulg"
    fill(FileLog(lambda: SharedLog(log, BEGINNING)))
    return log


def test_a_file_and_memory_have_the_same_rows(path: Path, tmp_path: Path) -> None:
    memory = MemoryLog()
    memory.begin(BEGINNING)
    fill(memory)
    saved = tmp_path / "saved.ulg"
    saved.write_bytes(b"".join(memory.encoded()))
    for log in (FlightFile(path), memory, FlightFile(saved)):
        for topic in FLIGHT_TOPICS:
            assert found(log, topic).tobytes() == rows_of(topic).tobytes()
    assert list(FlightFile(saved).inputs()) == [InputRecord(0, RecordKind.SETUP, b"{}")]


@given(numbers=st.lists(st.floats(), min_size=22, max_size=22), time_us=st.integers(0, 10**12))
def test_the_truth_keeps_every_bit(numbers: list[float], time_us: int) -> None:
    row = np.array([[time_us, *numbers]])
    encoded = np.frombuffer(TRUTH.encode(row), TRUTH.layout)
    assert TRUTH.decode(encoded).tobytes() == np.array([[time_us / 1e6, *numbers]]).tobytes()


def test_what_a_law_does_not_report_stays_not_a_number() -> None:
    row = np.zeros((1, len(DECISION.names)))
    unknown = [DECISION.names.index(name) for name in ("mass_kg", "path_lag_s", "qp_iterations")]
    row[0, unknown] = np.nan
    row[0, DECISION.names.index("fallback")] = -1.0
    assert np.array_equal(DECISION.decode(np.frombuffer(DECISION.encode(row), DECISION.layout)), row, equal_nan=True)


@pytest.mark.parametrize(("given", "kept"), [(1e300, np.inf), (70_000, 70_000.0), (-1e300, -np.inf)])
def test_numbers_beyond_the_range_of_a_column_are_kept_as_its_type_can(given: float, kept: float) -> None:
    log = MemoryLog()
    row = dict.fromkeys(DECISION.names, 0.0) | {"t": 8000, "delay_us": given, "active_rates": 70_000, "cost": given}
    log.add(DECISION, tuple(row.values()))
    found_row = dict(zip(DECISION.names, found(log, DECISION)[0].tolist(), strict=True))
    assert found_row == row | {"t": 0.008, "delay_us": kept, "active_rates": 70_000 % 2**16}


@given(content=st.binary(max_size=3 * CHUNK_BYTES))
def test_a_record_of_any_length_comes_back(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    log = tmp_path_factory.mktemp("log") / "flight.ulg"
    records = [InputRecord(7, RecordKind.FRAME, content), InputRecord(9, RecordKind.DATAGRAM, b"")]
    written = b"".join(encode_input(time_us, RecordKind(kind), each) for time_us, kind, each in records)
    log.write_bytes(BEGINNING + written)
    assert list(FlightFile(log).inputs()) == records
    log.write_bytes(BEGINNING + encode_input(7, RecordKind.FRAME, b"x" * 2 * CHUNK_BYTES)[:-1])
    assert list(FlightFile(log).inputs()) == []


def test_rows_before_a_cut_are_read(path: Path) -> None:
    whole = path.read_bytes()
    lengths = []
    for end in range(len(BEGINNING), len(whole), 997):
        path.write_bytes(whole[:end])
        rows = found(FlightFile(path), TRUTH)
        assert np.array_equal(rows, rows_of(TRUTH)[: len(rows)])
        lengths.append(len(rows))
    assert lengths == sorted(lengths)
    assert set(lengths) > {0, ROWS}


@pytest.mark.parametrize("damage", [bytes(40), b"\xff\xffD" + bytes(40)], ids=["no message", "a message too long"])
def test_reading_goes_on_at_the_next_mark(path: Path, damage: bytes) -> None:
    whole = path.read_bytes()
    at = whole.rindex(messages.SYNC)
    path.write_bytes(whole[:at] + damage + whole[at:])
    assert all(np.array_equal(found(FlightFile(path), topic), rows_of(topic)) for topic in FLIGHT_TOPICS)


@pytest.mark.parametrize("content", [b"", b"x" * 100, BEGINNING[:40]])
def test_another_file_is_no_flight_log(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "log").write_bytes(content)
    with pytest.raises(LogFormatError, match="log: no"):
        FlightFile(tmp_path / "log")
