"""Tables of `faults.md`: faults that can be injected."""

from collections.abc import Iterator
from pathlib import Path

from colibri.mavlink.hil.faults import ROWS, Part, Row, Value, kind_name, unit_name
from tools.pages.tables import renew_tables


def tables() -> list[str]:
    return ["\n".join(_rows(part)) for part in (Part.SENSORS, Part.BATTERY, Part.ROTORS)]


def _rows(part: Part) -> Iterator[str]:
    yield "| unit | type | what it does | numbers |"
    yield "|---|---|---|---|"
    for row in ROWS:
        if row.part is part:
            unit, kind = f"{unit_name(row.unit)} {row.unit}", f"{kind_name(row.kind)} {row.kind}"
            yield f"| {unit} | {kind} | {row.meaning} | {_numbers(row)} |"


def _numbers(row: Row) -> str:
    """Return the numbers of a row; the axes of a vector, which are alike, as one."""
    if len(row.values) == len("xyz"):
        name = row.values[0].name.removesuffix(" x")
        return _number(row.values[0], f"{name} x, y, z", ", ".join(f"{value.usual:g}" for value in row.values))
    return "; ".join(_number(value, value.name, f"{value.usual:g}") for value in row.values)


def _number(value: Value, name: str, usual: str) -> str:
    unit = "" if value.unit == "1" else f" {value.unit}"
    return f"{name}: {value.minimum:g} to {value.maximum:g}{unit} ({usual})"


def write(folder: Path) -> None:
    renew_tables(folder / "faults.md", tables())
