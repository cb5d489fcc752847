"""Strict tables for vehicle files, profiles and control laws."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import lru_cache
from math import isfinite
from pathlib import Path, PurePath
from typing import Annotated, Any, TypeAlias, TypeVar, cast

import msgspec

from colibri.common.errors import Error, checked, unknown
from colibri.common.files import read_bytes

Positive: TypeAlias = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0)]
UNREADABLE = (msgspec.MsgspecError, ValueError, RecursionError)  # invalid content, no UTF-8, too deep nesting
T = TypeVar("T")
_MOST = 1e12  # products of a few numbers up to there, and quotients, are finite


def plain(value: Any) -> Any:
    """Return NumPy's numbers and arrays, nested ones too, as Python's."""
    if hasattr(value, "dtype") and hasattr(value, "tolist"):
        return value.tolist()
    if type(value) in (list, tuple):
        return type(value)(map(plain, value))
    return {key: plain(each) for key, each in value.items()} if type(value) is dict else value


def toml_names(folder: Path) -> list[str]:
    return sorted(path.stem for path in folder.glob("*.toml"))


def read_named(what: str, folder: Path, name_or_path: str | PurePath, kind: type[T], error: type[Error]) -> T:
    """Read the TOML file of that name in `folder`, or at a path that ends in `.toml`."""
    checked(what, name_or_path, (str, PurePath), f"a name, a .toml file or a {what.capitalize()}", error)
    name_or_path = str(name_or_path)
    is_path = name_or_path.endswith(".toml")
    return read_toml(Path(name_or_path) if is_path else _named(what, folder, name_or_path, error), kind, error)


def named_text(what: str, folder: Path, name: str, error: type[Error]) -> str:
    return _named(what, folder, name, error).read_text(encoding="utf-8")


def _named(what: str, folder: Path, name: str, error: type[Error]) -> Path:
    known = toml_names(folder)
    if name not in known:
        raise error(unknown(what, name, [*known, "a .toml file"]))
    return folder / f"{name}.toml"


def read_toml(path: Path, kind: type[T], error: type[Error]) -> T:
    """Read a strict structure; `error` names file and key of what is missing, unknown or invalid."""
    try:
        found: T = _converted(read_bytes(path), cast(Any, kind))
        return found if _is_constant(found) else deepcopy(found)
    except OSError as reason:
        raise error(f"{path}: {reason.strerror}") from reason
    except msgspec.ValidationError as reason:
        raise error(f"{path}: {_in_words(reason, kind)}") from reason
    except UnicodeDecodeError as reason:
        line = reason.object.count(b"\n", 0, reason.start) + 1
        raise error(f"{path}: line {line}: is not UTF-8: save the file as that") from reason
    except UNREADABLE as reason:
        raise error(f"{path}: {reason}") from reason


@lru_cache(maxsize=32)
def _converted(content: bytes, kind: Any) -> Any:
    return msgspec.convert(msgspec.toml.decode(content), kind)  # takes milliseconds; every flight reads the same files


def _is_constant(found: object) -> bool:
    """Whether all parts are immutable, down to the last."""
    try:
        hash(found)
    except TypeError:
        return False
    return True


def _choices(kind: Any, key: str) -> str:
    found: Any = msgspec.inspect.type_info(kind)
    for name in key.replace("[", ".[").split("."):
        parts = found.types if isinstance(found, msgspec.inspect.UnionType) else (found,)
        fields = {field.name: field.type for part in parts for field in getattr(part, "fields", ())}
        items = [item for part in parts for item in getattr(part, "item_types", ())]
        found = items[0] if name.startswith("[") and items else fields.get(name)
    values = getattr(found, "values", ())
    return f": choose {', '.join(values)}" if values else ""


Negative: TypeAlias = Annotated[float, msgspec.Meta(lt=0.0)]
Degrees: TypeAlias = Annotated[float, msgspec.Meta(gt=0.0, le=180.0)]
Count: TypeAlias = Annotated[int, msgspec.Meta(ge=1, le=1000)]


class SettingsError(Error):
    """A missing, unknown or invalid key of a table."""


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a TOML file; its numbers must be finite."""

    def __post_init__(self) -> None:
        for key in self.__struct_fields__:
            for number, in_vector in _numbers(getattr(self, key)):
                least = 0.0 if in_vector else 1.0 / _MOST  # a place may have the rounding error of a cosine
                if number and not least <= abs(number) <= _MOST:
                    limits = "be finite" if not isfinite(number) else f"be 0, or from {1.0 / _MOST:g} to {_MOST:g}"
                    raise ValueError(f"{key}: must {limits}")


def _numbers(value: Any, depth: int = 0) -> Iterator[tuple[float, bool]]:
    """Yield each number, and whether it is in a list of vectors."""
    if isinstance(value, tuple):
        for part in value:
            yield from _numbers(part, depth + 1)
    elif isinstance(value, float):
        yield value, depth > 1


def read_settings(table: Mapping[str, Any], kind: type[T]) -> T:
    """Read a control law's table of a profile; raise `SettingsError` if a key is missing, unknown or invalid."""
    checked("table", table, Mapping, "a mapping of keys to values", SettingsError)
    try:
        return msgspec.convert(dict(table), type=kind)
    except msgspec.ValidationError as reason:
        raise SettingsError(_in_words(reason, kind)) from reason


def replaced(table: T, key: str, value: Any, error: type[Error]) -> T:
    """Return a copy with another, validated value at a dotted key: `body.mass_kg`, `rotors.strength.0`."""
    checked("key", key, str, "a dotted name", error)
    tree = _tree(table)
    parent, last = _place(tree, key, error)
    parent[last] = list(value) if isinstance(value, range) else plain(value)
    try:
        return msgspec.convert(tree, type=type(table))
    except msgspec.ValidationError as reason:
        raise error(_in_words(reason, type(table))) from reason


def value_at(table: object, key: str, error: type[Error]) -> Any:
    parent, last = _place(_tree(table), key, error)
    return parent[last]


def _tree(table: object) -> Any:
    return msgspec.msgpack.decode(msgspec.msgpack.encode(table))


def _place(tree: Any, key: str, error: type[Error]) -> tuple[Any, Any]:
    parent: Any = tree
    last: Any = ""
    found = tree
    for name in key.split("."):
        places = found if isinstance(found, dict) else dict(enumerate(found)) if isinstance(found, list) else {}
        choices = {str(place): place for place in places}
        if name not in choices:
            raise error(f"{key}: {unknown('key', name, choices)}")
        parent, found, last = found, places[choices[name]], choices[name]
    return parent, last


def _in_words(reason: msgspec.ValidationError, kind: Any) -> str:
    what, _, where = str(reason).partition(" - at `$.")
    key = where.rstrip("`")
    return f"{key}: {what}{_choices(kind, key)}" if key else what
