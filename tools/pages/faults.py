"""Tables of `faults.md`: faults that can be injected."""

from collections.abc import Iterator

from colibri.analysis.tables import markdown
from colibri.mavlink.hil import faults
from tools.pages.tables import with_tables

_SIZED = (faults.GARBAGE, faults.WRONG, faults.SLOW)


def tables() -> Iterator[str]:
    kinds = [(_kind(row.kind), row.meaning) for row in faults.ROWS if row.unit == faults.SENSORS[0]]
    yield markdown(("type", "effect on a sensor"), kinds, names=2)
    sizes = [(_unit(unit), *(_numbers(faults.TABLE[unit, kind]) for kind in _SIZED)) for unit in faults.SENSORS]
    yield markdown(("unit", *map(_kind, _SIZED)), sizes, names=4)
    parts = (faults.Equipment.BATTERY, faults.Equipment.ROTORS)
    others = [row for part in parts for row in faults.ROWS if row.part is part]
    rows = [(_unit(row.unit), _kind(row.kind), row.meaning, _numbers(row)) for row in others]
    yield markdown(("unit", "type", "effect", "numbers"), rows, names=4)


def _unit(unit: int) -> str:
    return f"{faults.unit_name(unit)} {unit}"


def _kind(kind: int) -> str:
    return f"{faults.kind_name(kind)} {kind}"


def _numbers(row: faults.FaultRow) -> str:
    """Return the numbers of a row, a vector as one."""
    if len(row.values) == len("xyz"):
        name = row.values[0].name.removesuffix(" x")
        return _number(row.values[0], f"{name} x, y, z", ", ".join(f"{value.usual:g}" for value in row.values))
    return "; ".join(_number(value, value.name, f"{value.usual:g}") for value in row.values)


def _number(value: faults.Value, name: str, usual: str) -> str:
    unit = "" if value.unit == "1" else f" {value.unit}"
    return f"{name}: {value.minimum:g} to {value.maximum:g}{unit} ({usual})"


PAGES = {"faults.md": lambda page: with_tables(page, tables())}
