"""`colibri verify`: the same flights twice, and what is not the same."""

from pathlib import Path
from typing import Any

import pytest

from colibri.cli.main import main
from colibri.verification import verify
from colibri.verification.cases import Case


def test_every_flight_is_the_same_twice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verify, "CASES", verify.CASES[::2])
    assert main(["verify", "--link", "memory", "--duration", "1.6", "--out", str(tmp_path)]) == 0
    table = capsys.readouterr().out
    assert table.count(" yes ") == len(verify.CASES)
    assert all((tmp_path / case.name / "first" / "flight.ulg").exists() for case in verify.CASES)


def test_what_is_not_the_same_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verify, "CASES", verify.CASES[1:2])
    fly = Case.fly
    seeds = iter((1, 2, 3))

    def another_each_time(case: Case, out: Path, link: str, **more: Any) -> str:
        return f"{next(seeds)}{fly(case, out, link, **more)}"

    monkeypatch.setattr(Case, "fly", another_each_time)
    with pytest.raises(SystemExit) as end:
        main(["verify", "--link", "memory", "--duration", "1", "--out", str(tmp_path)])
    assert end.value.code == 1
    said = capsys.readouterr()
    assert "NO" in said.out
    assert "not the same twice: spiral; the logs are in" in said.err
