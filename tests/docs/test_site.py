"""The site of docs/ is built, asks no other host for anything, and is not built over a broken link."""

import re
import subprocess
import sys
from pathlib import Path
from shutil import copy, copytree

import pytest

from tests.support.pages import DOCS, ROOT

_ASKED_FOR = re.compile(r"<(?:script|link|img|iframe|source|object|embed)\b[^>]*(?:src|href|data)=[\"']?(?:https?:)?//")
_ASKED_FOR_BY_STYLE = re.compile(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//")
_MADE_BY_SCRIPTS = ("mermaid", "glightbox", "pyodide", 'data-md-component="source"')
"""What the theme's script would fetch from another host: none of it may be on a page."""

pytestmark = pytest.mark.site


def build(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "zensical", "build", "--strict"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    copytree(DOCS, tmp_path / "docs")
    copy(ROOT / "zensical.toml", tmp_path)
    return tmp_path


def test_the_site_is_built_and_asks_nobody(project: Path) -> None:
    done = build(project)
    assert done.returncode == 0, done.stdout + done.stderr
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (project / "site").rglob("*.html")}
    assert {path.stem for path in DOCS.rglob("*.md")} <= pages.keys()
    for name, page in pages.items():
        assert not _ASKED_FOR.search(page), name
        bare = re.sub(r"<pre.*?</pre>|<code.*?</code>", "", page, flags=re.DOTALL)
        assert not any(mark in bare for mark in _MADE_BY_SCRIPTS), name
    for style in (project / "site").rglob("*.css"):
        assert not _ASKED_FOR_BY_STYLE.search(style.read_text(encoding="utf-8")), style.name


def test_a_broken_link_fails(project: Path) -> None:
    with (project / "docs" / "rotor-loss.md").open("a", encoding="utf-8") as page:
        page.write("\n[nowhere](nowhere.md) and [no heading](flight.md#no-heading)\n")
    done = build(project)
    assert done.returncode != 0
    assert "2 issues found" in re.sub(r"\x1b\[[\d;]*m", "", done.stdout + done.stderr)
