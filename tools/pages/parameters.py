"""`parameters.md`: the parameters of profile `flight`."""

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.control_law import DESCRIBED
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.parameters.store import FLOAT32_MAX, Kind, Parameter
from colibri.plant.vehicle.description import load_vehicle

_HEAD = """# Parameters

What a ground station can change, in flight too, of profile `flight` on its vehicle, by either of two control laws;
another one brings the numbers of its own table. Changes are kept in `--state` and hold at the next start. Written by
`python -m tools.pages parameters docs` from the definitions themselves; a test holds that they agree.
"""


def page() -> str:
    """Return the page."""
    profile = load_profile("flight")
    vehicle = load_vehicle(profile.simulation.vehicle)
    found = {p for law in DESCRIBED for p in definitions(profile.with_choices(law, None), vehicle)}
    ordered = sorted(found, key=lambda parameter: (parameter.group, parameter.name))
    lines = [_HEAD]
    for group, parameters in groupby(ordered, key=lambda parameter: parameter.group):
        lines += [f"## {group}", "", "| name | default | from | to | unit | what it is |", "|---|---|---|---|---|---|"]
        lines += [*_rows(parameters), ""]
    return "\n".join(lines)


def _rows(parameters: Iterator[Parameter]) -> Iterator[str]:
    for p in parameters:
        minimum, maximum = (_number(p, bound) for bound in (p.minimum, p.maximum))
        choices = "; ".join(f"{number} {meaning}" for number, meaning in p.values)
        notes = " ".join(filter(None, [p.description + ".", p.details, choices and f"({choices})"]))
        notes += " Read only." if p.read_only else " After a restart." if p.reboot_required else ""
        yield f"| `{p.name}` | {_number(p, p.default)} | {minimum} | {maximum} | {p.unit} | {notes} |"


def _number(parameter: Parameter, value: float) -> str:
    if parameter.kind == Kind.INT:
        return str(int(value))
    return "" if abs(value) >= FLOAT32_MAX else f"{value:.6g}"


def write(folder: Path) -> None:
    """Write the page."""
    (folder / "parameters.md").write_text(page(), encoding="utf-8")
