from pathlib import Path

from colibri.common.process.shared_log import SharedLog, remove_unused


def test_who_comes_second_appends_whatever_becomes_of_the_first(tmp_path: Path) -> None:
    path = tmp_path / "new" / "log"
    first = SharedLog(path, b"begin ")
    second = SharedLog(path, b"begin ", goes_on=True)
    first.append(b"one ")
    second.append(b"two ")
    first.close()  # killed, it is closed as well
    third = SharedLog(path, b"begin ")
    third.append(b"three ")
    second.append(b"four")
    assert path.read_bytes() == b"begin one two three four"
    second.close()
    third.close()


def test_another_flight_begins_anew_unless_it_shall_go_on(tmp_path: Path) -> None:
    path = tmp_path / "log"
    for goes_on, content in ((True, b"begin"), (True, b"begin"), (False, b"anew")):
        log = SharedLog(path, b"begin" if goes_on else b"anew", goes_on=goes_on)
        log.close()
        assert path.read_bytes() == content


def test_a_log_is_removed_unless_somebody_has_it_open(tmp_path: Path) -> None:
    path = tmp_path / "log"
    remove_unused(path)
    log = SharedLog(path, b"begin")
    remove_unused(path)
    assert path.exists()
    log.close()
    remove_unused(path)
    assert not path.exists()
