"""`colibri view` with what it cannot show."""

from pathlib import Path

import pytest

from colibri.cli.main import main


def test_a_folder_that_is_no_flight_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("provenance.json", "flight.ulg"):
        (tmp_path / name).touch()
    with pytest.raises(SystemExit) as ended:
        main(["view", str(tmp_path), "--no-browser"])
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert said.out.startswith("http://127.0.0.1:")
    assert said.err == f"colibri: error: {tmp_path / 'provenance.json'}: Input data was truncated\n"
