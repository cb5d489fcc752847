"""`colibri view` with what it cannot show."""

from pathlib import Path

import pytest

from colibri.cli.main import main


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["nowhere"], "no folder of a flight"),
        (["udpin:127.0.0.1:0", "out/spiral"], "one link, or folders of flights"),
        (["udpin:127.0.0.1"], "expected"),
        (["udpin:127.0.0.1:0", "--export", "x.html"], "give their folders"),
        (["out", "--port", "70000"], "from 0 to 65535"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(
    args: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(["view", *args, "--no-browser"])
    error = capsys.readouterr().err
    assert ended.value.code == 2
    assert said in error
    assert error.count("\n") == 1


def test_a_view_beside_needs_a_link_to_call(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["fly", "spiral", "--view", "--link", "memory"])
    assert "--view needs --link udp" in capsys.readouterr().err


def test_a_folder_that_is_no_flight_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("provenance.json", "flight.ulg"):
        (tmp_path / name).touch()
    with pytest.raises(SystemExit) as ended:
        main(["view", str(tmp_path), "--no-browser"])
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert said.out.startswith("http://127.0.0.1:")
    assert said.err == f"colibri: error: {tmp_path / 'provenance.json'}: Input data was truncated\n"
