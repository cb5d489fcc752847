"""Generated parts of pages that are written by hand otherwise."""

import re
from collections.abc import Iterable

_TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)


def with_body(page: str, body: Iterable[str], *, first: str = "## ", last: str = "") -> str:
    """Replace the lines from `first` up to `last`."""
    head = page[: page.index(f"\n{first}") + 1]
    text = head + "".join(f"{line}\n" for line in body)
    return text + page[page.index(f"\n{last}") + 1 :] if last else text.rstrip("\n") + "\n"


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def with_tables(page: str, tables: Iterable[str]) -> str:
    """Replace tables, each the next with its headings."""
    ahead = list(tables)

    def newest(found: re.Match[str]) -> str:
        headings = found[0].partition("\n")[0]
        if not ahead or not ahead[0].startswith(headings + "\n"):
            return found[0]
        return ahead.pop(0).rstrip() + "\n"

    page = _TABLE.sub(newest, page)
    assert not ahead, f"the page has no table {ahead[0].partition(chr(10))[0]}"
    return page
