"""Tables of pages that are otherwise written by hand."""

import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

_TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def renew_tables(path: Path, tables: Sequence[str]) -> None:
    path.write_text(with_tables(path.read_text(encoding="utf-8"), tables), encoding="utf-8")


def with_tables(page: str, tables: Iterable[str]) -> str:
    """Replace tables of a page, each the next one with the same headings."""
    ahead = list(tables)

    def newest(found: re.Match[str]) -> str:
        headings = found[0].partition("\n")[0]
        if not ahead or not ahead[0].startswith(headings + "\n"):
            return found[0]
        return ahead.pop(0).rstrip() + "\n"

    page = _TABLE.sub(newest, page)
    assert not ahead, f"the page has no table {ahead[0].partition(chr(10))[0]}"
    return page


def code(text: str) -> str:
    """Return a table cell with a text as code, for GitHub and the site, also with bars."""
    return f"<code>{escape(text, quote=False).replace('|', '&#124;')}</code>" if "|" in text else f"`{text}`"
