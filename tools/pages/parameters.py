"""`parameters.md`: the parameters of profile `flight`."""

import re
from collections.abc import Iterator
from itertools import groupby

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import DESCRIBED, definitions
from colibri.mavlink.parameters.store import FLOAT32_MAX, Parameter, ParamType
from colibri.plant.vehicle.description import load_vehicle
from tools.pages.tables import with_body

_INTRODUCTIONS = {
    **{f"Control law {law}": f"With their keys in table `controllers.{law}` of the profile." for law in DESCRIBED},
    "Vehicle model": "The vehicle as the autopilot assumes it, with the keys of the vehicle file.",
}
_KEY = re.compile(r"(?:Profile key controllers\.[\w-]+\.|Vehicle key )(\S*\w\]?).*")


def _sections() -> Iterator[str]:
    profile = load_profile("flight")
    vehicle = load_vehicle(profile.simulation.vehicle)
    found = {p for law in DESCRIBED for p in definitions(profile.with_choices(law, None), vehicle)}
    ordered = sorted(found, key=lambda parameter: (parameter.group, parameter.name))
    for group, parameters in groupby(ordered, key=lambda parameter: parameter.group):
        yield f"## {group}\n"
        if group in _INTRODUCTIONS:
            yield f"{_INTRODUCTIONS[group]}\n"
        yield from map(_item, parameters)
        yield ""


def _item(p: Parameter) -> str:
    choices = "; ".join(f"{number} {meaning}" for number, meaning in p.values)
    notes = " ".join(filter(None, [p.description + ".", _KEY.sub(r"`\1`", p.details), choices and f"({choices})"]))
    notes += " Read only." if p.read_only else " After a restart." if p.reboot_required else ""
    default, least, most = (_number(p, value) for value in (p.default, p.minimum, p.maximum))
    return f"- `{p.name}` {f'{default} {p.unit}'.strip()}, {least}…{most}: {notes}"


def _number(parameter: Parameter, value: float) -> str:
    if parameter.kind == ParamType.INT:
        return str(int(value))
    return "" if abs(value) >= FLOAT32_MAX else f"{value:.6g}"


PAGES = {"parameters.md": lambda page: with_body(page, _sections())}
