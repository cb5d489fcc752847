"""Tables as Markdown for people, and as CSV for programs."""

import csv
import re
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import TypeAlias

Row: TypeAlias = tuple[str, ...]

_MAX_WIDTH = 400


def write_table(path: Path, headings: Row, rows: Sequence[Row], *, names: int, notes: Sequence[str] = ()) -> list[Path]:
    """Write `path` as md, with notes, and as csv, whose columns are identifiers."""
    below = "".join(f"\n{note}\n" for note in notes)
    texts = {
        "md": markdown(headings, rows, names=names) + below,
        "csv": comma_separated(tuple(map(identifier, headings)), rows),
    }
    paths = [path.with_name(f"{path.name}.{suffix}") for suffix in texts]
    for written, text in zip(paths, texts.values(), strict=True):
        written.write_text(text, encoding="utf-8")
    return paths


def identifier(heading: str) -> str:
    """Return a heading as the name of a column: "QP p50 (µs)" is qp_p50_us."""
    plain = heading.lower().replace("µ", "u").replace("°", "deg").replace("%", "percent")
    return re.sub(r"[^\w]+", "_", plain).strip("_")


def markdown(headings: Row, rows: Sequence[Row], *, names: int) -> str:
    lines = [headings, (*["---"] * names, *["---:"] * (len(headings) - names)), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def print_table(title: str, headings: Row, rows: Sequence[Row], *, names: int) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for number, heading in enumerate(headings):
        table.add_column(heading.replace(" (", "\n("), justify="left" if number < names else "right", no_wrap=True)
    groups = len({row[0] for row in rows}) < len(rows)  # else a line would follow each row
    for row, following in zip(rows, [*rows[1:], ("",)], strict=True):
        table.add_row(*row, end_section=groups and following[0] != row[0])
    needed = Console(width=_MAX_WIDTH).measure(table).maximum
    Console(width=max(Console().width, needed)).print(table)


def comma_separated(headings: Row, rows: Sequence[Row]) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([headings, *rows])
    return text.getvalue()
