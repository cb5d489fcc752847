import os
from pathlib import Path

import numpy as np
import pytest

from colibri.common.process.slot_file import MAX_BYTES, SLOT, Slots
from colibri.common.serialization import of_bytes, to_bytes


def opened(path: Path) -> bytes | None:
    slots = Slots(path)
    newest = slots.newest()
    slots.close()
    return newest


def test_the_newest_is_found_by_another_process(tmp_path: Path) -> None:
    path = tmp_path / "state" / "flight"
    slots = Slots(path)
    assert slots.newest() is None
    for number in range(5):
        assert slots.write(b"%d" % number * number)
        assert slots.newest() == opened(path) == b"%d" % number * number
    again = Slots(path)
    again.write(b"later")
    assert opened(path) == b"later"


def test_half_a_record_is_never_believed(tmp_path: Path) -> None:
    """Whichever byte of the newest is not there yet, the one before is what is found."""
    path = tmp_path / "flight"
    slots = Slots(path)
    slots.write(b"before")
    before = path.read_bytes()
    slots.write(b"after")
    after = path.read_bytes()
    changed = [at for at in range(len(after)) if after[at] != before[at]]
    for at in changed:
        path.write_bytes(after[:at] + bytes([after[at] ^ 0x40]) + after[at + 1 :])
        assert opened(path) == b"before"
    path.write_bytes(after)
    assert opened(path) == b"after"


@pytest.mark.parametrize("content", [b"", b"short", bytes(2 * SLOT), b"\xff" * 2 * SLOT])
def test_a_strange_file_holds_nothing_and_is_used(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "flight"
    path.write_bytes(content)
    slots = Slots(path)
    assert slots.newest() is None
    assert slots.write(b"first")
    assert opened(path) == b"first"


def test_what_does_not_fit_leaves_what_is_there(tmp_path: Path) -> None:
    slots = Slots(tmp_path / "flight")
    assert slots.write(bytes(MAX_BYTES))
    assert not slots.write(bytes(MAX_BYTES + 1))
    assert slots.newest() == bytes(MAX_BYTES)


def test_arrays_are_plain_and_other_things_are_not() -> None:
    array = np.arange(6.0).reshape(2, 3)
    content = to_bytes((array, None, 1.5))
    kept = of_bytes(tuple[np.ndarray, None, float], content)
    assert kept is not None
    assert (kept[0] == array).all()
    assert of_bytes(int, content) is None
    assert of_bytes(np.ndarray, to_bytes(((2, 2), b"12345678"))) is None
    for strange in (object(), np.arange(3)):
        with pytest.raises(TypeError):
            to_bytes(strange)


def test_the_disk_has_room_for_all_of_it_from_the_start(tmp_path: Path) -> None:
    path = tmp_path / "slots"
    path.write_bytes(b"")
    os.truncate(path, 2 * SLOT)  # all of it a hole
    for slots in (Slots(path), Slots(tmp_path / "new")):
        slots.close()
    for each in (path, tmp_path / "new"):
        with each.open("rb") as file:
            assert os.lseek(file.fileno(), 0, os.SEEK_HOLE) == 2 * SLOT


def test_a_truncated_file_is_written_again(tmp_path: Path) -> None:
    """Where the file was mapped, the next write ended the process by SIGBUS."""
    path = tmp_path / "flight"
    slots = Slots(path)
    for size, content in ((0, b"one"), (SLOT + 5, b"two"), (3, b"three")):
        os.truncate(path, size)
        assert slots.newest() in (None, b"one")
        assert slots.write(content)
        assert slots.newest() == content
    assert opened(path) is None  # its size says that it was cut
