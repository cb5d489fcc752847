"""Numerical kernels: how they are compiled, and when their machine code on disk is renewed."""

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

Packed: TypeAlias = NDArray[np.void]

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compile a function at its first call, and keep the machine code on disk for every later process.

    The disk's copy is renewed when its own file changes, or that of a kernel it calls.

    Arithmetic stays IEEE 754's in the order written, so that a kernel gives the same bits on every computer; division
    by zero gives an infinity, as in numpy.
    """
    return cast(_Function, _kernel(function))


def compiled_for(*signatures: str) -> Callable[[_Function], _Function]:
    """Return `compiled` for arguments of these types alone, at once: whatever else can be is converted to them."""

    def compiled_now(function: _Function) -> _Function:
        kernel = _kernel(function)
        for signature in signatures:
            kernel.compile(signature)
        kernel.disable_compile()
        return cast(_Function, kernel)

    return compiled_now


def packed(parameters: NamedTuple) -> Packed:
    """Return the record of `parameters`, (1,): one pointer to hand to a kernel instead of a hundred numbers."""
    return np.array([tuple(parameters)], dtype=_fields(parameters))


def _fields(parameters: Any) -> list[tuple[str, Any, tuple[int, ...]]]:
    """Return the fields of a record: float64 but for arrays of another type and for what has fields itself."""
    fields: list[tuple[str, Any, tuple[int, ...]]] = []
    for name, value in parameters._asdict().items():
        if hasattr(value, "_fields"):
            fields.append((name, _fields(value), ()))
        else:
            fields.append((name, getattr(value, "dtype", np.float64), np.shape(value)))
    return fields


def files_of(function: Callable[..., Any]) -> set[str]:
    """Return the files that a function's machine code is made of: its own, and those of what it calls by name."""
    files: set[str] = set()
    seen: set[Any] = set()
    waiting: list[Any] = [function]
    while waiting:
        it = waiting.pop()
        it = getattr(it, "py_func", it)
        if not isinstance(it, FunctionType) or it in seen:
            continue
        seen.add(it)
        files.add(it.__code__.co_filename)
        waiting += [it.__globals__.get(name) for name in it.__code__.co_names]
    return files


def _kernel(function: Callable[..., Any]) -> Any:
    """Return the kernel of a function; numba by itself renews it with its own file only."""
    kernel: Any = njit(cache=True, error_model="numpy")(function)
    kernel._cache._cache_file._source_stamp = tuple(sorted(map(_hash, files_of(function))))  # noqa: SLF001
    return kernel


@cache
def _hash(file: str) -> str:
    return sha256(Path(file).read_bytes()).hexdigest()
