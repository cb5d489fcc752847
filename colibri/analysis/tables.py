"""Tables for people (Markdown) and for programs (CSV)."""

import csv
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import TypeAlias

Row: TypeAlias = tuple[str, ...]


def write_table(path: Path, headings: Row, rows: Sequence[Row], *, names: int) -> list[Path]:
    """Write a table as `path` with the suffixes md and csv; return what was written.

    Args:
        path: Without suffix.
        headings: One a column.
        rows: Their cells.
        names: How many columns from the left are names, the others being numbers.
    """
    texts = {"md": markdown(headings, rows, names=names), "csv": comma_separated(headings, rows)}
    paths = [path.with_name(f"{path.name}.{suffix}") for suffix in texts]
    for written, text in zip(paths, texts.values(), strict=True):
        written.write_text(text, encoding="utf-8")
    return paths


def markdown(headings: Row, rows: Sequence[Row], *, names: int) -> str:
    """Return a Markdown table, its first columns names, the others numbers."""
    lines = [headings, (*["---"] * names, *["---:"] * (len(headings) - names)), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def comma_separated(headings: Row, rows: Sequence[Row]) -> str:
    """Return a table as CSV; what holds a comma is quoted."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([headings, *rows])
    return text.getvalue()
