"""Pages that are written from the code say what the code says."""

from pathlib import Path

from tools.pages import faults, parameters

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_parameters_is_current() -> None:
    assert (DOCS / "parameters.md").read_text() == parameters.page()


def test_the_page_of_faults_is_current() -> None:
    assert (DOCS / "faults.md").read_text() == faults.page()
