"""Numbers in nested tables as parameters: paths, names, values."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from math import isfinite
from typing import Any, TypeAlias

from colibri.mavlink.parameters.numbers import Number, NumberPath
from colibri.mavlink.parameters.store import FLOAT32_MAX, INT32_MAX, INT32_MIN, Value

Tree: TypeAlias = dict[str, Any]

_UNITS = {
    "_rad_s": "rad/s",
    "_m_s2": "m/s^2",
    "_m_s": "m/s",
    "_1_s": "1/s",
    "_n_m": "N m",
    "_deg": "deg",
    "_rad": "rad",
    "_kg": "kg",
    "_s": "s",
    "_m": "m",
    "_n": "N",
}
"""Units by the ending of a key, longest first."""
_MAX_NAME_CHARS = 16
_MAX_WORD_CHARS = 8


def read(tree: Mapping[str, Any], path: NumberPath) -> Any:
    """Return the value at `path`, or raise KeyError."""
    here: Any = tree
    for key in path:
        try:
            here = here[key]
        except (LookupError, TypeError):
            raise KeyError(path) from None
    return here


def has(tree: Mapping[str, Any], path: NumberPath) -> bool:
    try:
        return is_number(read(tree, path))
    except KeyError:
        return False


def changed(tree: Tree, numbers: Iterable[Number], values: Mapping[str, Value], defaults: Mapping[str, Value]) -> Tree:
    """Return the tree with all changed values; unchanged numbers keep 64 bits."""
    for number in numbers:
        if values[number.name] != defaults[number.name]:
            value = values[number.name]
            tree = _with(tree, number.path, value if isinstance(value, int) else value * number.scale)
    return tree


def _with(tree: Any, path: NumberPath, value: Value) -> Any:
    if not path:
        return value
    key, *rest = path
    inner = _with(tree[key], tuple(rest), value)
    if isinstance(key, str):
        return {**tree, key: inner}
    return [*tree[:key], inner, *tree[key + 1 :]]


def is_number(value: Any) -> bool:
    """Whether a parameter can hold this value."""
    if isinstance(value, bool):
        return False
    if isinstance(value, int):
        return INT32_MIN <= value <= INT32_MAX
    return isinstance(value, float) and isfinite(value) and abs(value) <= FLOAT32_MAX


def paths(tree: Any, before: NumberPath = ()) -> Iterator[NumberPath]:
    if is_number(tree):
        yield before
    elif isinstance(tree, Mapping):
        for key in sorted(tree):
            yield from paths(tree[key], (*before, key))
    elif isinstance(tree, list | tuple):
        for place, inner in enumerate(tree):
            yield from paths(inner, (*before, place))


def named(prefix: str, tree: Mapping[str, Any], excluded: frozenset[str]) -> list[Number]:
    """Return numbers named by prefix and shortened keys."""
    taken: set[str] = set()
    numbers = []
    for path in paths(tree):
        if path[0] in excluded:
            continue
        plain, unit = _without_unit(path)
        name = next(name for name in _names(prefix, plain) if name not in taken)
        taken.add(name)
        numbers.append(Number(name, path, unit, description=described(path)))
    return numbers


def described(path: NumberPath) -> str:
    """Return a path as text: a.b[1]."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)
    return text.removeprefix(".")


def _without_unit(path: NumberPath) -> tuple[NumberPath, str]:
    place = max(place for place, key in enumerate(path) if isinstance(key, str))
    key = str(path[place])
    for ending, unit in _UNITS.items():
        if key.endswith(ending) and key != ending:
            return (*path[:place], key.removesuffix(ending), *path[place + 1 :]), unit
    return path, ""


def _names(prefix: str, path: NumberPath) -> Iterator[str]:
    words = [_plain(word) for key in path if isinstance(key, str) for word in key.split("_")]
    places = "".join(str(key + 1) for key in path if isinstance(key, int))
    room = _MAX_NAME_CHARS - len(prefix) - 1 - len(places)
    for length in range(_MAX_WORD_CHARS, 0, -1):
        text = "_".join(filter(None, (word[:length] for word in words)))
        if len(text) <= room:
            yield f"{prefix}_{text}{places}"
    text = "_".join(filter(None, words))
    for number in count(1):
        end = f"_{number}"
        yield f"{prefix}_{text[: max(_MAX_NAME_CHARS - len(prefix) - 1 - len(end), 0)].rstrip('_')}{end}"


def _plain(word: str) -> str:
    return "".join(letter for letter in word.upper() if letter.isascii() and letter.isalnum())
