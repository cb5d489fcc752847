"""`profile-keys.md` and `vehicle-keys.md`, from the structures that read the files."""

import ast
import re
from collections.abc import Callable, Iterator
from inspect import cleandoc, getsource
from textwrap import dedent
from typing import Any

from msgspec import inspect as kinds

from colibri.autopilot.control import scaling
from colibri.autopilot.control.geometric import GeometricSettings
from colibri.autopilot.control.lpv_mpc.law import LpvMpcSettings
from colibri.autopilot.control.profile import ProfileTables, profile_names, profile_text
from colibri.autopilot.control.thesis.cascade import CascadeSettings
from colibri.autopilot.control.thesis.global_mpc import GlobalSettings
from colibri.plant.vehicle.description import Vehicle, vehicle_names, vehicle_text
from tools.pages.tables import with_body

LAWS: dict[str, Any] = {
    "lpv-mpc": LpvMpcSettings,
    "geometric-se3": GeometricSettings,
    "cascade": CascadeSettings,
    "global-lpv-mpc": GlobalSettings,
}
_SOURCE = re.compile(r"^\s*([\w-]+)\s*=\s*(.+?)\s*(?:#\s*(.*))?$")
_MORE = re.compile(r"^\s{12,}#\s*(.*)$")
_BOUNDS = {"gt": "above", "ge": "from", "lt": "below", "le": "to"}


def profiles() -> Iterator[str]:
    said, shown = _said("flight", profile_names(), profile_text), dict[Any, str]()
    yield from _sections(ProfileTables, "", said, shown)
    for law, settings in LAWS.items():
        yield from _sections(settings, f"controllers.{law}", said, shown)
        if law in scaling.LAWS:
            yield from _sections(scaling.LAWS[law][0], f"controllers.{law}.scaling", said, shown)


def vehicles() -> Iterator[str]:
    return _sections(Vehicle, "", _said("hummingbird", vehicle_names(), vehicle_text), {})


def _said(first: str, names: list[str], text_of: Callable[[str], str]) -> dict[str, tuple[str, str, str]]:
    """Return value, comment and file of each dotted key, first of `first`, which is not named."""
    found: dict[str, tuple[str, str, str]] = {}
    for name in sorted(names, key=lambda name: name != first):
        table = key = ""
        for line in text_of(name).splitlines():
            if heading := re.match(r"\s*\[([\w.-]+)\]", line):
                table, key = heading[1], ""
            elif entry := _SOURCE.match(line):
                key = f"{table}.{entry[1]}".lstrip(".")
                if key in found:
                    key = ""
                else:
                    found[key] = (entry[2], entry[3] or "", "" if name == first else f" ({name})")
            elif key and (more := _MORE.match(line)):
                value, comment, where = found[key]
                found[key] = (value, f"{comment} {more[1]}", where)
    return found


def _sections(kind: Any, above: str, said: dict[str, tuple[str, str, str]], shown: dict[Any, str]) -> Iterator[str]:
    info = kinds.type_info(kind)
    assert isinstance(info, kinds.StructType)
    yield f"## `[{above}]`\n" if above else "## Top of the file\n"
    if kind in shown:
        yield f"The keys of `[{shown[kind]}]`.\n"
        return
    shown[kind] = above
    yield f"{_first_line(kind)}\n"
    notes, inner = _notes(kind), []
    for field in info.fields:
        key = f"{above}.{field.encode_name}".lstrip(".")
        parts = field.type.types if isinstance(field.type, kinds.UnionType) else (field.type,)
        table = next((part.cls for part in parts if isinstance(part, kinds.StructType)), None)
        value, comment, where = said.get(key, ("", "", ""))
        note = notes.get(field.name) or comment
        if table is not None:
            inner.append((table, key))
            note = note if note != _first_line(table) else ""
        example = f"; `{value}`{where}" if value else ""
        what = ("a table" if table is not None else _what(field.type)) + _optional(field) + example
        yield f"- `{field.encode_name}`: {what}" + (f". {note}" if note else "")
    yield ""
    for table, key in inner:
        yield from _sections(table, key, said, shown)


def _optional(field: kinds.Field) -> str:
    if field.required:
        return ""
    default = field.default
    shown = "" if default in (None, "") else f": {list(default) if isinstance(default, tuple) else default}"
    return f"; may be left out{shown}"


def _first_line(kind: Any) -> str:
    return cleandoc(kind.__doc__).partition("\n\n")[0].replace("\n", " ")


def _what(kind: kinds.Type) -> str:
    match kind:
        case kinds.Metadata():
            return _what(kind.type)
        case kinds.FloatType() | kinds.IntType():
            limits = [(word, getattr(kind, name)) for name, word in _BOUNDS.items()]
            bounds = [f"{word} {limit:g}" for word, limit in limits if limit is not None]
            return " ".join(["whole number" if isinstance(kind, kinds.IntType) else "number", *bounds])
        case kinds.LiteralType():
            return " or ".join(f"`{value}`" for value in kind.values)
        case kinds.TupleType():
            each = ", ".join({_what(item): None for item in kind.item_types})
            return re.sub(r"number\b", "numbers", f"{len(kind.item_types)} {each}")
        case kinds.VarTupleType():
            each = re.sub(r"^(?=\d)", "groups of ", _what(kind.item_type))
            return "list of " + re.sub(r"(list|number)\b", r"\1s", each)
        case kinds.UnionType():
            return " or ".join(_what(part) for part in kind.types if not isinstance(part, kinds.NoneType))
        case kinds.DictType():
            return "tables"
        case kinds.CustomType():
            return kind.cls.__name__
    return "yes or no: `true`, `false`" if type(kind).__name__ == "BoolType" else "text"


def _notes(kind: Any) -> dict[str, str]:
    """Return the docstring below each field."""
    notes: dict[str, str] = {}
    for part in reversed(kind.__mro__):
        if not part.__module__.startswith("colibri."):
            continue
        (tree,) = ast.parse(dedent(getsource(part))).body
        assert isinstance(tree, ast.ClassDef)
        for field, below in zip(tree.body, tree.body[1:], strict=False):
            if (
                isinstance(field, ast.AnnAssign)
                and isinstance(below, ast.Expr)
                and isinstance(below.value, ast.Constant)
            ):
                assert isinstance(field.target, ast.Name)
                notes[field.target.id] = " ".join(str(below.value.value).split())
    return notes


PAGES = {
    "profile-keys.md": lambda page: with_body(page, profiles()),
    "vehicle-keys.md": lambda page: with_body(page, vehicles()),
}
