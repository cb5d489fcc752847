"""What is written of the scenarios agrees with them; what compares runs of them sees a difference."""

from pathlib import Path

import pytest

from tests.scenarios.groups import GROUPS
from tests.scenarios.page import PAGE, page
from tools.soak import scenarios as soak

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_agrees_with_the_scenarios() -> None:
    assert (DOCS / PAGE).read_text(encoding="utf-8") == page()


def test_there_are_sixty_and_each_has_a_name_of_its_own() -> None:
    named = [scenario.name for scenarios in GROUPS.values() for scenario in scenarios]
    assert len(set(named)) == len(named) >= 60


def test_runs_that_were_kept_are_compared_and_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ran: list[str] = []

    def run(link: str, kept: Path, _only: str) -> str:
        ran.append(link)
        kept.write_text("a passed 1\n", encoding="utf-8")
        return "flown"

    monkeypatch.setattr(soak, "_run", run)
    soaked = ["--keep", str(tmp_path), "--runs"]
    assert soak.main([*soaked, "2"]) == 0
    assert soak.main([*soaked, "3"]) == 0
    assert ran == ["memory", "udp", "memory"]
    (tmp_path / "0003-memory").write_text("a failed 1\n", encoding="utf-8")
    assert soak.main([*soaked, "3"]) == 1
    assert "a: passed 1 at first, failed 1 now" in capsys.readouterr().out
    for kept in tmp_path.iterdir():
        kept.write_text("a failed 1\n", encoding="utf-8")
    assert soak.main([*soaked, "3"]) == 1
