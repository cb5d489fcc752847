"""`parameters.md`: the parameters of profile `flight`."""

from collections.abc import Iterator
from itertools import groupby

from colibri.analysis.tables import markdown
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.control_law import DESCRIBED
from colibri.autopilot.parameters.definitions import definitions
from colibri.mavlink.parameters.store import FLOAT32_MAX, Parameter, ParamType
from colibri.plant.vehicle.description import load_vehicle
from tools.pages.tables import with_body


def _sections() -> Iterator[str]:
    profile = load_profile("flight")
    vehicle = load_vehicle(profile.simulation.vehicle)
    found = {p for law in DESCRIBED for p in definitions(profile.with_choices(law, None), vehicle)}
    ordered = sorted(found, key=lambda parameter: (parameter.group, parameter.name))
    for group, parameters in groupby(ordered, key=lambda parameter: parameter.group):
        yield f"## {group}\n"
        yield markdown(("name", "default", "from", "to", "unit", "what it is"), list(map(_row, parameters)), names=6)


def _row(p: Parameter) -> tuple[str, ...]:
    choices = "; ".join(f"{number} {meaning}" for number, meaning in p.values)
    notes = " ".join(filter(None, [p.description + ".", p.details, choices and f"({choices})"]))
    notes += " Read only." if p.read_only else " After a restart." if p.reboot_required else ""
    return (f"`{p.name}`", *(_number(p, value) for value in (p.default, p.minimum, p.maximum)), p.unit, notes)


def _number(parameter: Parameter, value: float) -> str:
    if parameter.kind == ParamType.INT:
        return str(int(value))
    return "" if abs(value) >= FLOAT32_MAX else f"{value:.6g}"


PAGES = {"parameters.md": lambda page: with_body(page, _sections())}
