"""`python-api.md`: public names with signatures and docstrings."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any, get_args

from colibri.common.spec import Option, described, fields_of
from tools.pages.tables import cell, with_body

FACES = ("colibri", "colibri.sitl")
_SECTION = re.compile(r"^(Args|Returns|Raises|Yields|Attributes):$")
_ENTRY = re.compile(r"^    (\*{0,2}\w+)(?: \(.*?\))?: (.*)$")


def _sections() -> Iterator[str]:
    shown: set[int] = set()
    for face in FACES:
        package = import_module(face)
        yield f"## {face}\n\n{inspect.getdoc(package)}\n"
        for name in sorted(package.__all__, key=str.lower):
            thing = getattr(package, name)
            if id(thing) not in shown:
                shown.add(id(thing))
                yield from _thing(name, thing)


def _thing(name: str, thing: Any) -> Iterator[str]:
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        yield f"### {name}\n\nA type: `{thing}`.\n"
        return
    yield f"### {name}\n"
    if inspect.isfunction(thing):
        yield f"```\n{_signature(name, thing)}\n```\n"
    yield _text(inspect.getdoc(thing) or "")
    if inspect.isclass(thing):
        yield from _options(thing)
        yield from _members(thing)


def _options(kind: type) -> Iterator[str]:
    if is_dataclass(kind) and Option in (type(note) for each in fields(kind) for note in get_args(each.type)):
        yield "| option | |\n|---|---|"
        for name, field in fields_of(kind).items():
            if field.option.keyword:
                yield f"| `{name}` | {cell(described(field))} |"
        yield ""


def _members(kind: type) -> Iterator[str]:
    rows = []
    for name, member in inspect.getmembers(kind):
        owner = next((base for base in kind.__mro__ if name in vars(base)), kind)
        if name.startswith("_") or not owner.__module__.startswith("colibri."):
            continue
        if inspect.isfunction(member) or inspect.ismethod(member):
            shown = _signature(name, member)
        elif isinstance(member, property) or type(member).__name__ == "cached_property":
            shown = name
        else:
            continue
        said = _sentence(inspect.getdoc(member) or "")
        if said:
            rows.append(f"| `{cell(shown)}` | {cell(said)} |")
    if rows:
        yield "| | |\n|---|---|\n" + "\n".join(rows) + "\n"


def _signature(name: str, function: Any) -> str:
    """Return names and defaults of the arguments; types are in the docstrings where they matter."""
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
    in_section = False
    for line in doc.splitlines():
        section, entry = _SECTION.match(line), _ENTRY.match(line)
        if section:
            in_section = True
            lines += [f"*{section[1]}*", ""]
        elif in_section and entry:
            lines.append(f"- `{entry[1]}`: {entry[2]}")
        elif in_section and line.startswith("        "):
            lines[-1] += f" {line.strip()}"
        else:
            in_section = in_section and (not line or line.startswith(" "))
            lines.append(line.strip() if in_section else line)
    return "\n".join(lines) + "\n"


PAGES = {"python-api.md": lambda page: with_body(page, _sections())}
