"""Links and pictures of README and docs/ lead somewhere; every page is in the site's navigation; README is short."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.pages import DOCS, PAGES, ROOT, anchors, links, prose

README_LINES = 120
_OPEN = ("https://", "http://127.0.0.1", "http://localhost")


@pytest.mark.parametrize("page", [*sorted(ROOT.glob("*.md")), *PAGES[1:]], ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(page):
        if link.startswith(_OPEN):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.is_file(), f"{page.name}: {link}: there is no such file"
        if page.parent == DOCS:
            assert target.is_relative_to(DOCS), f"{page.name}: {link}: the site has docs/ only"
        if anchor:
            assert anchor in anchors(target), f"{page.name}: {link}: there is no such heading"


def in_navigation(entry: Any) -> Iterator[str]:
    if isinstance(entry, str):
        yield entry
    else:
        for part in entry.values() if isinstance(entry, dict) else entry:
            yield from in_navigation(part)


def test_every_page_is_in_the_navigation_once() -> None:
    project = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]
    listed = list(in_navigation(project["nav"]))
    assert sorted(listed) == sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))
    assert [name for part in project["nav"] for name in part] == [
        *("Start", "Tutorials", "How-to", "Reference", "Explanation")
    ]


def test_readme_is_short_and_shows_a_moving_picture() -> None:
    readme = ROOT / "README.md"
    assert len(readme.read_text(encoding="utf-8").splitlines()) <= README_LINES
    (moving,) = [link for link in links(readme) if link.endswith((".png", ".gif"))]
    assert (ROOT / moving).stat().st_size <= 1_500_000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_bar_in_code_is_shown_with_its_backslash(page: Path) -> None:
    r"""Of `a\|b` in a table the site shows the backslash, GitHub does not; `<code>a&#124;b</code>` both show alike."""
    assert not re.findall(r"`[^`\n]*\\\|[^`\n]*`", prose(page))
