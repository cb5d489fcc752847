"""The tables of `files.md`: columns of each topic."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from colibri.analysis.tables import markdown
from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, Columns
from tools.pages.tables import with_tables

_MANY = 6
_CODES: dict[str, Mapping[Any, int]] = {"qp_status": STATUS_CODES, "fallback": FALLBACK_CODES}


def _tables() -> Iterator[str]:
    for topic in FLIGHT_TOPICS:
        yield markdown((f"of `{topic.name}`", "unit", "meaning"), list(_rows(topic.columns)), names=3)


def _rows(columns: Iterable[Columns]) -> Iterator[tuple[str, ...]]:
    for each in columns:
        names = each.names.split()
        shown = names if len(names) <= _MANY else [names[0], "…", names[-1]]
        codes = ", ".join(f"{code} {name or 'none'}" for name, code in _CODES.get(each.names, {}).items())
        meaning = each.help + (f": {codes}" if codes else "")
        yield ", ".join(name if name == "…" else f"`{name}`" for name in shown), each.unit, meaning


PAGES = {"files.md": lambda page: with_tables(page, _tables())}
