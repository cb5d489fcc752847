from pathlib import Path
from typing import Any

import pytest

from colibri.verification import verify
from colibri.verification.golden_flights import TrackCase
from tests.support.commands import Ran


def test_every_flight_is_the_same_twice(tmp_path: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify, "CASES", verify.CASES[::2])
    table = ran("verify", "--link", "memory", "--duration", "1.6", "--out", tmp_path).out
    assert table.count(" yes ") == len(verify.CASES)
    assert all((tmp_path / case.name / "first" / "flight.ulg").exists() for case in verify.CASES)


def test_what_is_not_the_same_is_named(tmp_path: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verify, "CASES", verify.CASES[1:2])
    fly = TrackCase.fly
    seeds = iter((1, 2, 3))

    def another_each_time(case: TrackCase, out: Path, link: str, **more: Any) -> str:
        return f"{next(seeds)}{fly(case, out, link, **more)}"

    monkeypatch.setattr(TrackCase, "fly", another_each_time)
    said = ran("verify", "--link", "memory", "--duration", "1", "--out", tmp_path, code=1)
    assert "NO" in said.out
    assert "not the same twice: spiral; the logs are in" in said.err
