"""`python-api.md`: public names with signatures and docstrings."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from itertools import groupby
from operator import itemgetter
from typing import Any, get_args

from colibri.common.spec import Option, fields_of
from tools.pages.tables import with_body

FACES = ("colibri", "colibri.sitl")
_SECTION = re.compile(r"^(Args|Returns|Raises|Yields|Attributes):$")
_ENTRY = re.compile(r"^    (\*{0,2}\w+(?:, \w+)*)(?: \(.*?\))?: (.*)$")
_OPTIONS = {
    "FlightSpec": "[`colibri fly`](cli.md#colibri-fly)",
    "Setting": "[initial conditions](scenarios.md#initial-conditions) and [`colibri fly`](cli.md#colibri-fly)",
}
"""Where options are described."""
_INTERNAL = {
    "FlightPlan": "autopilot_spec floor_m flown_by integrator plant_spec plant_vehicle_name start_yaw_rad vehicle_name",
    "Flights": "keep summary",
    "Record": "add note",
    "Setting": "autopilot_spec chosen delay_s law law_name load plant_spec started weather",
    "FlightSpec": "chosen delay_s law law_name load pace started weather",
    "Sitl": "begin fly_frame have_others_catch_up",
    "Station": "add arriving check departing listen request",
    "TuningResults": "add_check file_of headings save_verdict",
    "CampaignResults": "groups headings through usual_metric",
}
"""Members that only Colibri's own packages call."""


def _sections() -> Iterator[str]:
    shown: set[int] = set()
    origins = _origins()
    for face in FACES:
        package = import_module(face)
        yield f"## {face}\n\n{inspect.getdoc(package)}\n"
        things = {name: getattr(package, name) for name in sorted(package.__all__, key=str.lower)}
        new = {name: thing for name, thing in things.items() if id(thing) not in shown}
        shown.update(map(id, new.values()))
        errors = {name: thing for name, thing in new.items() if _is_plain_error(thing)}
        for name, thing in new.items():
            if name not in errors:
                yield from _thing(name, thing, origins)
        yield "### Errors\n"
        yield from (f"- `{name}`: {_sentence(inspect.getdoc(thing) or '')}" for name, thing in errors.items())
        yield ""


def _is_plain_error(thing: Any) -> bool:
    return inspect.isclass(thing) and issubclass(thing, Exception) and "Attributes:" not in (thing.__doc__ or "")


def _thing(name: str, thing: Any, origins: dict[str, str]) -> Iterator[str]:
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        yield f"### {name}\n\nA type: `{thing}`.\n"
        return
    yield f"### {name}\n"
    if inspect.isfunction(thing):
        yield f"```\n{_signature(name, thing)}\n```\n"
    parts = [_text(inspect.getdoc(thing) or "")]
    if inspect.isclass(thing):
        parts += [*_options(thing), *_members(thing, origins)]
    yield re.sub(r"(?m)^(- .*)\n\n+(?=- )", r"\1\n", "\n".join(parts))


def _options(kind: type) -> Iterator[str]:
    if is_dataclass(kind) and Option in (type(note) for each in fields(kind) for note in get_args(each.type)):
        names = ", ".join(f"`{name}`" for name, field in fields_of(kind).items() if field.option.keyword)
        yield f"Options, described in {_OPTIONS[kind.__name__]}: {names}.\n"


def _origins() -> dict[str, str]:
    """Return the class that describes a member, by its row: the first, or its base."""
    origins: dict[str, type] = {}
    for package in map(import_module, FACES):
        for name in sorted(package.__all__, key=str.lower):
            kind = getattr(package, name)
            for _, row in _rows(kind) if inspect.isclass(kind) else ():
                if row not in origins or kind in origins[row].__mro__:
                    origins[row] = kind
    return {row: kind.__name__ for row, kind in origins.items()}


def _members(kind: type, origins: dict[str, str]) -> Iterator[str]:
    rows = dict(_rows(kind))
    repeated = sorted((origins[row], name) for name, row in rows.items() if origins[row] != kind.__name__)
    for other, same in groupby(repeated, key=itemgetter(0)):
        yield f"As in `{other}`: {', '.join(f'`{name}`' for _, name in same)}.\n"
    own = [row for row in rows.values() if origins[row] == kind.__name__]
    if own:
        yield "\n".join(own) + "\n"


def _rows(kind: type) -> Iterator[tuple[str, str]]:
    """Yield names and lines of documented public members."""
    internal = _INTERNAL.get(kind.__name__, "").split()
    members = dict(inspect.getmembers(kind))
    assert members.keys() >= set(internal), f"{kind.__name__} lacks {set(internal) - members.keys()}"
    for name, member in members.items():
        owner = next((base for base in kind.__mro__ if name in vars(base)), kind)
        if name.startswith("_") or name in internal or not owner.__module__.startswith("colibri."):
            continue
        if inspect.isfunction(member) or inspect.ismethod(member):
            shown = _signature(name, member)
        elif isinstance(member, property) or type(member).__name__ == "cached_property":
            shown = name
        else:
            continue
        said = _sentence(inspect.getdoc(member) or "")
        if said:
            yield name, f"- `{shown}`: {said}"


def _signature(name: str, function: Any) -> str:
    parts, star = [], False
    for parameter in inspect.signature(function).parameters.values():
        if parameter.name == "self":
            continue
        if parameter.kind is parameter.KEYWORD_ONLY and not star:
            parts.append("*")
            star = True
        star = star or parameter.kind is parameter.VAR_POSITIONAL
        prefix = {"VAR_POSITIONAL": "*", "VAR_KEYWORD": "**"}.get(parameter.kind.name, "")
        default = "" if parameter.default is parameter.empty else f"={_default(parameter.default)}"
        parts.append(f"{prefix}{parameter.name}{default}")
    return f"{name}({', '.join(parts)})"


def _default(value: object) -> str:
    plain = value is None or isinstance(value, bool | int | float | str | tuple)
    return repr(value) if plain and not re.search(" at 0x", repr(value)) else "..."


def _sentence(doc: str) -> str:
    return " ".join(doc.partition("\n\n")[0].split())


def _text(doc: str) -> str:
    lines: list[str] = []
    in_section, begin = False, "- "
    for line in doc.splitlines():
        section, entry = _SECTION.match(line), _ENTRY.match(line)
        if section:
            in_section, begin = True, "Raises " if section[1] == "Raises" else "- "
            lines += [f"*{section[1]}*", ""] if section[1] not in ("Raises", "Attributes") else []
        elif in_section and entry:
            names = ", ".join(f"`{name}`" for name in entry[1].split(", "))
            lines.append(f"{begin}{names}: {entry[2]}")
        elif in_section and line.startswith("        "):
            lines[-1] += f" {line.strip()}"
        else:
            in_section = in_section and (not line or line.startswith(" "))
            lines.append(line.strip() if in_section else line)
    return "\n".join(lines) + "\n"


PAGES = {"python-api.md": lambda page: with_body(page, _sections())}
