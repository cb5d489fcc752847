"""What is written of the scenarios agrees with them; what compares runs of them sees a difference."""

from pathlib import Path

import pytest

from tests.sitl import GROUPS
from tests.sitl.page import PAGE, page
from tests.sitl.soak import DiffersError, compare

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_agrees_with_the_scenarios() -> None:
    assert (DOCS / PAGE).read_text(encoding="utf-8") == page()


def test_there_are_sixty_and_each_has_a_name_of_its_own() -> None:
    named = [scenario.name for scenarios in GROUPS.values() for scenario in scenarios]
    assert len(set(named)) == len(named) >= 60


@pytest.mark.parametrize(
    "again", [{"a": "passed 1"}, {"a": "failed 1", "b": "passed 2"}, {"a": "passed 3", "b": "passed 2"}]
)
def test_a_run_that_differs_is_named(again: dict[str, str]) -> None:
    first = {"a": "passed 1", "b": "passed 2"}
    compare(first, dict(first))
    with pytest.raises(DiffersError, match=r"[ab]: "):
        compare(first, again)
