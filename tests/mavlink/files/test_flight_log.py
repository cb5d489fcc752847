from errno import ENOENT, ENOSPC, ENOTDIR

import pytest

from colibri.mavlink.files.flight_log import WRITE_BYTES, WRITE_EVERY_US, FlightLog
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.files.tree import Quota


@pytest.fixture
def memory() -> MemoryFiles:
    memory = MemoryFiles()
    memory.make_folder(("logs",))
    return memory


def names(memory: MemoryFiles) -> list[str]:
    return [entry.name for entry in memory.list(("logs",))]


def content(memory: MemoryFiles, name: str) -> bytes:
    reading = memory.open(("logs", name))
    return reading.read(0, reading.size)


def fly(log: FlightLog, data: bytes = b"") -> None:
    log.update(True, 0)
    log.record(data)
    log.update(False, 2)


def test_each_flight_has_its_own(memory: MemoryFiles) -> None:
    log = FlightLog(memory, ("logs",))
    fly(log, b"one")
    fly(log, b"two")
    fly(FlightLog(memory, ("logs",)), b"three")  # after a restart
    assert names(memory) == ["00001.ulg", "00002.ulg", "00003.ulg"]
    assert content(memory, "00003.ulg") == b"three"


def test_it_is_written_every_second_and_when_much_waits(memory: MemoryFiles) -> None:
    log = FlightLog(memory, ("logs",))
    log.update(True, 0)
    log.record(b"x")
    log.update(True, WRITE_EVERY_US - 1)
    assert content(memory, "00001.ulg") == b""
    log.update(True, WRITE_EVERY_US)
    assert content(memory, "00001.ulg") == b"x"
    log.record(b"y" * WRITE_BYTES)
    log.update(True, WRITE_EVERY_US + 1)
    assert content(memory, "00001.ulg") == b"x" + b"y" * WRITE_BYTES


def test_the_oldest_logs_go(memory: MemoryFiles) -> None:
    log = FlightLog(memory, ("logs",), kept=3)
    memory.create(("logs", "notes.txt"))
    for _ in range(5):
        fly(log)
    assert names(memory) == ["00003.ulg", "00004.ulg", "00005.ulg", "notes.txt"]


def test_the_oldest_logs_give_their_space() -> None:
    memory = MemoryFiles(Quota(1000, 100))
    memory.make_folder(("logs",))
    log = FlightLog(memory, ("logs",))
    for _ in range(3):
        fly(log, b"x" * 300)
    fly(log, b"y" * 400)
    assert names(memory) == ["00002.ulg", "00003.ulg", "00004.ulg"]
    refusals = [log.refusal]
    fly(log, b"z" * 2000)
    assert names(memory) == ["00005.ulg"]
    assert [*refusals, log.refusal] == [None, ENOSPC]


def test_a_log_that_is_removed_ends_and_the_next_one_begins(memory: MemoryFiles) -> None:
    log = FlightLog(memory, ("logs",))
    log.update(True, 0)
    log.record(b"x")
    memory.remove(("logs", "00001.ulg"))
    memory.remove_folder(("logs",))
    log.update(False, 1)
    assert (log.name, log.refusal) == (None, ENOENT)
    fly(log, b"again")
    assert log.refusal is None
    assert content(memory, "00001.ulg") == b"again"


def test_without_a_place_nothing_is_logged(memory: MemoryFiles) -> None:
    memory.create(("file",))
    log = FlightLog(memory, ("file",))
    fly(log, b"x")
    assert (log.name, log.refusal) == (None, ENOTDIR)


@pytest.mark.parametrize("name", ["x.ulg", "-1.ulg", "².ulg", "00000.ulg", "7.txt", "12"])
def test_other_files_are_no_logs(memory: MemoryFiles, name: str) -> None:
    memory.create(("logs", name))
    fly(FlightLog(memory, ("logs",), kept=1))
    assert set(names(memory)) == {"00001.ulg", name}
