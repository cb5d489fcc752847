"""Log files: rows that lose no bit, and are there whatever end the process has."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.common.process.log_files import CsvLog, LogError, set_aside


@given(row=st.lists(st.floats() | st.integers(-9, 9), min_size=1, max_size=5))
def test_a_row_keeps_every_bit(tmp_path_factory: pytest.TempPathFactory, row: list[float]) -> None:
    folder = tmp_path_factory.mktemp("log")
    log = CsvLog(folder / "log.csv", ["x"] * len(row))
    log.add(row)
    log.close()
    _, line = (folder / "log.csv").read_text(encoding="utf-8").splitlines()
    assert [float(value).hex() for value in line.split(",")] == [float(value).hex() for value in row]


def test_what_is_no_number_has_its_word_and_numpy_its_digits(tmp_path: Path) -> None:
    log = CsvLog(tmp_path / "log.csv", ("a", "b", "c", "d"))
    log.add((nan, inf, -inf, 0.5))
    log.add((np.float64(0.1), 2, 1e-5, -0.0))
    log.close()
    assert (tmp_path / "log.csv").read_text(encoding="utf-8") == "a,b,c,d\nnan,inf,-inf,0.5\n0.1,2,0.00001,-0.0\n"


def test_rows_are_written_a_block_at_a_time(tmp_path: Path) -> None:
    """Who is killed loses less than a block."""
    path = tmp_path / "log.csv"
    log = CsvLog(path, ("a",))
    for row in range(2 * CsvLog.BLOCK + 3):
        log.add((row,))
    assert path.read_text(encoding="utf-8").splitlines() == ["a", *map(str, range(2 * CsvLog.BLOCK))]
    log.close()
    assert path.read_text(encoding="utf-8").splitlines() == ["a", *map(str, range(2 * CsvLog.BLOCK + 3))]


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    """Let the system refuse to write beyond `size` bytes of any file, as it does on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_reported_once_and_rows_stay_whole(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    log = CsvLog(path, ("a", "b"))
    with no_file_beyond(15):
        log.add((1.25, 2.5))
        log.add((3.75, 4.5))
        with pytest.raises(LogError, match=r"cannot go on writing .*log\.csv: File too large"):
            log.flush()
    log.add((5.0, 6.0))
    log.close()
    assert path.read_text(encoding="utf-8") == "a,b\n1.25,2.5\n"


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
