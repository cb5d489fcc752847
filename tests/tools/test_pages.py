"""Pages that are written from the code say what the code says."""

from pathlib import Path

from tools import fault_page, parameter_page

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_of_parameters_is_current() -> None:
    assert (DOCS / "parameters.md").read_text() == parameter_page.page()


def test_the_page_of_faults_is_current() -> None:
    assert (DOCS / "faults.md").read_text() == fault_page.page()
