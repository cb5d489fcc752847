import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from colibri.common.process.log_files import BlockLog, LogError, set_aside


def test_records_are_written_a_block_at_a_time(tmp_path: Path) -> None:
    """A process that is killed loses less than a block."""
    path = tmp_path / "log"
    log = BlockLog(path)
    records = [f"{number}\n".encode() for number in range(2 * BlockLog.BLOCK + 3)]
    for record in records:
        log.add(record)
    assert path.read_bytes() == b"".join(records[: 2 * BlockLog.BLOCK])
    log.close()
    assert path.read_bytes() == b"".join(records)


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_reported_once_and_records_stay_whole(tmp_path: Path) -> None:
    path = tmp_path / "log"
    log = BlockLog(path)
    with no_file_beyond(15):
        log.add(b"1.25,2.5\n")
        log.add(b"3.75,4.5\n")
        with pytest.raises(LogError, match=r"cannot go on writing .*log: File too large"):
            log.flush()
    log.add(b"5.0,6.0\n")
    log.close()
    assert path.read_bytes() == b"1.25,2.5\n"


def test_finished_logs_get_a_new_number(tmp_path: Path) -> None:
    names = ("plant.csv", "flight.tlog")
    for name in (*names, "flight-1.tlog"):
        (tmp_path / name).write_text(name, encoding="utf-8")
    set_aside(*(tmp_path / name for name in names), tmp_path / "not-there.csv")
    (tmp_path / "plant.csv").write_text("again", encoding="utf-8")
    set_aside(*(tmp_path / name for name in names))
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == {
        "flight-1.tlog": "flight-1.tlog",
        "flight-2.tlog": "flight.tlog",
        "plant-2.csv": "plant.csv",
        "plant-3.csv": "again",
    }
