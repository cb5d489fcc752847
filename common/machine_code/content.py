"""The key of a kernel's machine code: all that it is compiled from."""

import sys
from collections.abc import Callable, Iterator
from enum import EnumMeta
from functools import cache
from hashlib import sha256
from inspect import getclosurevars
from linecache import getlines
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import llvmlite
import numba
import numpy as np

from colibri.common.machine_code import results

_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.dtype)


def key_of(kernel: Any) -> str:
    """Return a hash of versions, sources and global values; processor and argument types are in numba's index."""
    versions = (sys.version, numba.__version__, llvmlite.__version__, np.__version__, hash_of(results.__file__))
    name = f"{kernel.__module__}.{kernel.__qualname__}"
    contents = sorted(text for it in functions_of(kernel) for text in _contents_of(it))
    return sha256("\n".join((*versions, name, _text_of(kernel), *contents)).encode()).hexdigest()[:32]


def functions_of(function: Callable[..., Any]) -> set[FunctionType]:
    """Return a function and all that it calls."""
    seen: set[FunctionType] = set()
    waiting: list[Any] = [function]
    while waiting:
        it = waiting.pop()
        it = getattr(it, "py_func", it)
        if isinstance(it, FunctionType) and it not in seen:
            seen.add(it)
            waiting += _values_of(it).values()
    return seen


@cache
def _contents_of(function: FunctionType) -> list[str]:
    values = {**_values_of(function), "its defaults": function.__defaults__}
    texts = ((name, _text_of(value)) for name, value in values.items())
    return [hash_of(function.__code__.co_filename), *(f"{name}={text}" for name, text in texts if text)]


@cache
def _values_of(function: FunctionType) -> dict[str, Any]:
    names = (name for code in _codes_of(function.__code__) for name in code.co_names)
    known = {name: function.__globals__[name] for name in names if name in function.__globals__}
    return {**known, **getclosurevars(function).nonlocals}


def _codes_of(code: CodeType) -> Iterator[CodeType]:
    yield code
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _codes_of(inner)


def _text_of(value: Any) -> str:
    """Return what of a value becomes part of machine code; functions' files are read instead."""
    if isinstance(value, np.ndarray | np.generic):
        return f"{value.dtype.descr}{value.shape}{value.tobytes().hex()}"
    if isinstance(value, tuple):
        return f"{type(value).__name__}({','.join(map(_text_of, value))})"
    if isinstance(value, EnumMeta):
        return repr(list(value.__members__.items()))
    if isinstance(value, type) and hasattr(value, "_fields"):
        return f"{value.__module__}.{value.__qualname__}{value._fields}"
    if hasattr(value, "targetoptions"):
        return repr(sorted(value.targetoptions.items()))
    return repr(value) if isinstance(value, _PLAIN) else ""


def fields_of(types: Any) -> tuple[Any, ...]:
    """Return the field names of named tuples among argument types, which numba's index leaves out."""
    if not isinstance(types, tuple):
        return ()
    return tuple((it.fields, fields_of(it.types)) for it in types if hasattr(it, "instance_class"))


@cache
def hash_of(file: str) -> str:
    try:
        return sha256(Path(file).read_bytes()).hexdigest()
    except OSError:  # a cell of a notebook
        if not (lines := getlines(file)):
            raise
        return sha256("".join(lines).encode()).hexdigest()
