"""Options of a flight as typed fields of frozen dataclasses, read from a command line, keywords or JSON.

    latency: Annotated[float, Option("the delay of the link, one way", least=0.0, most=1000.0, unit="ms")] = 0.0

Values are Python's, or command-line texts: `wind="5@270"`, `start={"x": 1.0}`.
"""

from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import MISSING, fields
from enum import StrEnum
from math import inf, isfinite, isinf, nan
from pathlib import Path, PurePath
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, cast, get_args, get_origin

import msgspec

from colibri.common.config import UNREADABLE, plain
from colibri.common.errors import Error, unknown

ENDLESS = "max"  # an infinite number as text
_INFINITE = {ENDLESS: inf, f"-{ENDLESS}": -inf}

S = TypeVar("S")


class SpecError(Error):
    """An unknown option or an invalid value."""


class Option(NamedTuple):
    """Description of an option beyond type and default."""

    help: str
    metavar: str | None = None  # default: choices or name
    unit: str = ""
    least: float = -inf
    above: float = -inf
    most: float = inf
    endless: bool = False  # may be infinite, `max` as text
    read: Callable[[str], Any] | None = None  # parser of a text; default: by type
    flag: str | None = None  # name on the command line, if different
    on_command_line: bool = True
    keyword: bool = True  # for Python and campaigns


class Field(NamedTuple):
    name: str
    kind: Any  # of the value, or of each of several; without None
    repeated: bool  # a tuple of values
    default: Any  # MISSING if required
    option: Option

    @property
    def choices(self) -> tuple[str, ...]:
        if get_origin(self.kind) is Literal:
            return get_args(self.kind)
        return tuple(self.kind) if isinstance(self.kind, type) and issubclass(self.kind, StrEnum) else ()

    @property
    def _kinds(self) -> tuple[Any, ...]:
        return get_args(self.kind) if get_origin(self.kind) is Union else (self.kind,)

    def read(self, given: Any) -> Any:
        """Return the validated value of a value or text; `None` is the default."""
        if given is None or (isinstance(given, str) and not given):
            return self.default
        if not self.repeated:
            return self._one(given)
        several = isinstance(given, Iterable) and not isinstance(given, str | Mapping) and not hasattr(given, "_fields")
        return tuple(map(self._one, given if several else (given,)))

    def read_text(self, text: str) -> Any:
        if self.option.read is not None:
            return self.option.read(text)
        if self.choices:
            return self._choice(text)
        if self.kind in (int, float):
            return self._number(text)
        return Path(text) if self.kind is Path else text

    def _one(self, given: Any) -> Any:
        given = plain(given)
        if isinstance(given, str | PurePath):
            return self.read_text(str(given))
        if hasattr(given, "_asdict") and get_origin(self.kind) is Mapping:
            given = given._asdict()
        if isinstance(given, Mapping) and self.option.read is not None and get_origin(self.kind) is Mapping:
            return self.read_text(",".join(f"{key}={value}" for key, value in given.items())) if given else {}
        if self.kind is Any:
            return given
        if self.kind in (int, float):
            return self._number(given)
        if isinstance(given, tuple(kind for kind in self._kinds if isinstance(kind, type))):
            return given
        try:
            read = msgspec.convert(given, self.kind, dec_hook=lambda kind, value: kind(value))
            return self.read_text(str(read)) if hasattr(read, "_fields") and self.option.read is not None else read
        except msgspec.ValidationError as error:
            words = " or ".join("a name" if kind is str else f"a {kind.__name__}" for kind in self._kinds)
            if self.choices or (self.option.read is not None and self.option.metavar):
                words = self.option.metavar or f"one of {', '.join(self.choices)}"
            where = str(error).partition(" - at ")[2]
            reason = f"must be {words}, not {type(given).__name__}" if not where else str(error).replace("`", "")
            raise ArgumentTypeError(reason) from error

    def _choice(self, text: str) -> Any:
        if text not in self.choices:
            raise ArgumentTypeError(unknown("value", text, self.choices))
        return self.kind(text) if isinstance(self.kind, type) else text

    def _number(self, given: Any) -> float:
        try:
            if isinstance(given, bool):
                raise ValueError
            if self.kind is int and not isinstance(given, str) and given != int(given):
                raise ValueError
            value: float = _INFINITE[given] if given in _INFINITE else self.kind(given)
        except (TypeError, ValueError, OverflowError):
            value = nan
        least, above, most = self.option.least, self.option.above, self.option.most
        right = isfinite(value) or (isinf(value) and self.option.endless)
        if not (right and least <= value <= most and (value > above or isinf(above))):
            raise ArgumentTypeError(f"must be {self._range()}, not {given}")
        return value

    def _range(self) -> str:
        option = self.option
        unit = f" {option.unit}" if option.unit else ""
        whole = "a whole number" if self.kind is int else "a number"
        words = f", or {ENDLESS}" if option.endless else ""
        if isfinite(option.least) and isfinite(option.most):
            return f"{whole} from {option.least:g} to {option.most:g}{unit}{words}"
        if isfinite(option.above):
            return f"{whole} above {option.above:g}{unit}{words}"
        return (f"{whole} of at least {option.least:g}{unit}" if isfinite(option.least) else f"{whole}{unit}") + words


def fields_of(spec: type) -> dict[str, Field]:
    """Return the options of a specification, its own before those of its bases."""
    if spec not in _FIELDS:
        known = {each.name: each for each in fields(cast(Any, spec))}
        names = [name for kind in spec.__mro__ for name in vars(kind).get("__annotations__", ()) if name in known]
        _FIELDS[spec] = {name: _field(known[name]) for name in names}
    return _FIELDS[spec]


def _field(each: Any) -> Field:
    kind, *notes = get_args(each.type)
    assert get_origin(each.type) is Annotated, f"{each.name} carries an Option"
    kinds = [it for it in get_args(kind) if it is not NoneType] if get_origin(kind) in (Union, UnionType) else [kind]
    of = kinds[0] if len(kinds) == 1 else Union[tuple(kinds)]  # noqa: UP007
    default = each.default if each.default_factory is MISSING else each.default_factory()
    repeated = get_origin(of) is tuple and get_args(of)[-1] is Ellipsis
    (option,) = (note for note in notes if isinstance(note, Option))
    return Field(each.name, get_args(of)[0] if repeated else of, repeated, default, option)


_FIELDS: dict[type, dict[str, Field]] = {}


def add_options(
    parser: ArgumentParser,
    spec: type,
    *,
    leave_out: Collection[str] = (),
    defaults: Mapping[str, Any] = {},
    shown: Mapping[str, str] = {},
    given_only: bool = False,
    keywords_only: bool = False,
) -> None:
    """Add options to a command line; `shown` has defaults in words, `given_only` sets no attribute for omitted ones."""
    for field in fields_of(spec).values():
        wanted = field.option.keyword if keywords_only else field.option.on_command_line
        if wanted and field.name not in leave_out:
            _add(parser, field._replace(default=defaults.get(field.name, field.default)), shown, given_only=given_only)


def _add(parser: ArgumentParser, field: Field, shown: Mapping[str, str], *, given_only: bool) -> None:
    option, default = field.option, field.default
    words = described(field, shown.get(field.name)).replace("%", "%%")
    name = f"--{(option.flag or field.name).replace('_', '-')}"
    choices: dict[str, Any] = {"help": words}
    if field.kind is bool:
        name = f"--no-{name[2:]}" if default else name
        choices |= {"action": "store_false" if default else "store_true"}
    else:
        metavar = option.metavar or "|".join(field.choices) or field.name.upper()
        choices |= {"type": field.read_text, "metavar": metavar}
    if default is MISSING:
        parser.add_argument(field.name, **choices)
        return
    if field.repeated:
        choices |= {"action": "append", "help": f"{words}; may be repeated"}
        default = list(default)
    parser.add_argument(name, dest=field.name, default=SUPPRESS if given_only else default, **choices)


def described(field: Field, default: str | None = None) -> str:
    words = field.option.help
    if default is not None:
        return f"{words} (default: {default})"
    value = field.default
    plain = isinstance(value, int | float | str | PurePath) and not isinstance(value, bool)
    if "(default" in words or not (plain or hasattr(value, "_fields")):
        return words
    return f"{words} (default {ENDLESS if value == inf else f'{value:g}' if isinstance(value, float) else value})"


def from_namespace(spec: type[S], args: Namespace, **others: Any) -> S:
    given = vars(args) | others
    values = {name: given[name] for name in fields_of(spec) if name in given}
    return spec(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})


def from_values(
    spec: type[S], values: Mapping[str, Any], error: type[Error] = SpecError, only: Collection[str] | None = None
) -> S:
    """Return the specification of values or texts; raise `error` on an unknown or invalid option."""
    return spec(**read_values(spec, values, error, only))


def read_values(
    spec: type, values: Mapping[str, Any], error: type[Error] = SpecError, only: Collection[str] | None = None
) -> dict[str, Any]:
    known = fields_of(spec)
    for name in values:
        if name not in (known if only is None else only):
            raise error(unknown("option", name, only or known))
    return {name: _checked(known[name], value, error) for name, value in values.items()}


def _checked(field: Field, value: Any, error: type[Error]) -> Any:
    try:
        read = field.read(value)
    except ArgumentTypeError as reason:
        raise error(f"{field.name}: {reason}") from None
    if read is MISSING:
        raise error(f"{field.name}: a value is required")
    return read


def keywords_of(spec: type) -> list[str]:
    return sorted(name for name, field in fields_of(spec).items() if field.option.keyword)


def values_of(spec: object) -> dict[str, Any]:
    return {name: getattr(spec, name) for name in fields_of(type(spec))}


def part_of(spec: object, kind: type[S], **others: Any) -> S:
    """Return a specification of another kind with the values it shares, updated by `others`."""
    known = fields_of(kind)
    return kind(**({name: value for name, value in values_of(spec).items() if name in known} | others))


def plain_values(spec: object, *, whole: bool = False) -> dict[str, Any]:
    """Return values as JSON types, without defaults unless `whole`; raise `SpecError` for other objects."""
    values = {}
    for name, field in fields_of(type(spec)).items():
        value = getattr(spec, name)
        if value == field.default and not whole:
            continue
        if isinstance(value, float) and isinf(value):
            value = ENDLESS if value > 0.0 else f"-{ENDLESS}"
        try:
            values[name] = msgspec.to_builtins(value, enc_hook=_plain)
        except TypeError as error:
            raise SpecError(f"{name}: an object cannot be passed to another process: use a name") from error
    return values


def _plain(value: Any) -> Any:
    if isinstance(value, PurePath):
        return str(value)
    raise TypeError


def to_json(spec: object) -> bytes:
    return msgspec.json.encode(plain_values(spec))


def from_json(spec: type[S], text: bytes) -> S:
    try:
        values = msgspec.json.decode(text, type=dict[str, Any])
    except UNREADABLE as error:
        raise SpecError(f"no specification: {error}") from error
    return from_values(spec, values)
