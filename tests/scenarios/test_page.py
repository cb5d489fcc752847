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


def test_a_run_that_differs_and_a_failure_fail_the_soak(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes = iter(["passed 1", "passed 1", "passed 1", "failed 1", "failed 1", "failed 1"])
    links: list[str] = []

    def run(link: str) -> dict[str, str]:
        links.append(link)
        return {"a": next(outcomes)}

    monkeypatch.setattr(soak, "_run", run)
    assert soak.main(["--runs", "2"]) == 0
    assert soak.main(["--runs", "2"]) == 1
    assert "a: passed 1 at first, failed 1 now" in capsys.readouterr().out
    assert soak.main(["--runs", "2"]) == 1
    assert links == ["memory", "udp"] * 3
