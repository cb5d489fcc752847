"""Tables of `faults.md`: faults that can be injected."""

from colibri.analysis.tables import markdown
from colibri.mavlink.hil.faults import ROWS, Equipment, FaultRow, Value, kind_name, unit_name
from tools.pages.tables import with_tables


def _table(part: Equipment) -> str:
    rows = [
        (f"{unit_name(row.unit)} {row.unit}", f"{kind_name(row.kind)} {row.kind}", row.meaning, _numbers(row))
        for row in ROWS
        if row.part is part
    ]
    return markdown(("unit", "type", "what it does", "numbers"), rows, names=4)


def _numbers(row: FaultRow) -> str:
    """Return the numbers of a row; the axes of a vector as one."""
    if len(row.values) == len("xyz"):
        name = row.values[0].name.removesuffix(" x")
        return _number(row.values[0], f"{name} x, y, z", ", ".join(f"{value.usual:g}" for value in row.values))
    return "; ".join(_number(value, value.name, f"{value.usual:g}") for value in row.values)


def _number(value: Value, name: str, usual: str) -> str:
    unit = "" if value.unit == "1" else f" {value.unit}"
    return f"{name}: {value.minimum:g} to {value.maximum:g}{unit} ({usual})"


PAGES = {
    "faults.md": lambda page: with_tables(page, map(_table, (Equipment.SENSORS, Equipment.BATTERY, Equipment.ROTORS)))
}
