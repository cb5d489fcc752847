"""Pages that are written from the code say what the code says."""

from pathlib import Path

import pytest

from tools.pages.__main__ import main
from tools.pages.tables import with_tables

DOCS = Path(__file__).parents[2] / "docs"


def test_a_table_replaces_the_one_with_its_headings() -> None:
    page = "a\n\n| x |\n|---|\n| 1 |\n\n| y |\n|---|\n| 2 |\n\n| x |\n|---|\n| 3 |\n"
    assert with_tables(page, ["| x |\n|---|", "| x |\n|---|\n| 4 |"]) == (
        "a\n\n| x |\n|---|\n\n| y |\n|---|\n| 2 |\n\n| x |\n|---|\n| 4 |\n"
    )
    with pytest.raises(AssertionError, match=r"no table \| z \|"):
        with_tables(page, ["| z |\n|---|"])


@pytest.mark.parametrize("page", ["failsafes", "faults", "modes"])
def test_a_page_is_written_with_its_pictures(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = tmp_path / f"{page}.md"
    written.write_bytes((DOCS / f"{page}.md").read_bytes())
    monkeypatch.setattr("sys.argv", ["pages", page, str(tmp_path)])
    assert main() == 0
    assert written.read_bytes() == (DOCS / f"{page}.md").read_bytes()
    assert (tmp_path / f"{page}.png").exists() is (DOCS / f"{page}.png").exists()
