"""Numbers that parameters set, and their tables: CSV files with a line for each."""

import csv
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from colibri.mavlink.parameters.store import FLOAT32_MAX, Parameter, ParamType, Value

NumberPath: TypeAlias = tuple[str | int, ...]
"""Keys and list indices, outermost first; in a file `a.b.1`."""


class Number(NamedTuple):
    """A parameter for the number at `path`, which is `scale` times its value."""

    name: str
    path: NumberPath = ()
    unit: str = ""
    minimum: Value = -FLOAT32_MAX
    maximum: Value = FLOAT32_MAX
    description: str = ""
    scale: float = 1.0
    decimals: int = 3
    default: Value = 0
    kind: str = ""  # integer of 8 (b), 16 (h) or 32 (i) bits, or float (f); empty: by the default
    group: str = ""
    details: str = ""
    values: tuple[tuple[int, str], ...] = ()  # valid values with meanings, if not all; in a file `0=Off|1=On`
    read_only: bool = False

    def parameter(self, default: Value, group: str = "", details: str = "", wire: int = 0) -> Parameter:
        """Return the parameter; its bounds widen to include the default."""
        return _parameter(self, default, group, details, wire)


@lru_cache(maxsize=4096, typed=True)
def _parameter(number: Number, default: Value, group: str, details: str, wire: int) -> Parameter:
    same = {field: value for field, value in number._asdict().items() if field not in ("path", "scale", "kind")}
    same |= {"minimum": min(number.minimum, default), "maximum": max(number.maximum, default), "default": default}
    same |= {"details": details or number.details, "group": group or number.group}
    return Parameter(**same, kind=ParamType.REAL if isinstance(default, float) else ParamType.INT, wire=wire)


def _number(text: str) -> Value:
    return int(text) if text.removeprefix("-").isdecimal() else float(text)


def _path(text: str) -> NumberPath:
    return tuple(int(key) if key.isdecimal() else key for key in text.split("."))


def _values(text: str) -> tuple[tuple[int, str], ...]:
    pairs = (pair.split("=") for pair in text.split("|"))
    return tuple((int(number), meaning) for number, meaning in pairs)


_READERS: Mapping[str, Callable[[str], Any]] = {
    **dict.fromkeys(("minimum", "maximum", "scale", "decimals", "default"), _number),
    "path": _path,
    "values": _values,
    "read_only": bool,
}


def read_numbers(file: Path) -> tuple[Number, ...]:
    """Return the lines of a table, whose columns are fields of `Number`."""
    with file.open(encoding="ascii", newline="") as lines:
        rows = list(csv.DictReader(lines))
    return tuple(
        Number(**{field: _READERS.get(field, str)(text) for field, text in row.items() if text}) for row in rows
    )
