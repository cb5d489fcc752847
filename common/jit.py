"""Numerical kernels: how they are compiled, and when their machine code on disk is renewed."""

import os
import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from stat import S_ISDIR
from tempfile import gettempdir
from types import FunctionType
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np
from numba import __version__, config, njit
from numba.core.event import Event, Listener, register
from numpy.typing import NDArray

Packed: TypeAlias = NDArray[np.void]

_SAID = "COLIBRI_SAID_UNCACHED"
_NOWHERE = (
    "colibri: machine code can be kept nowhere, so each start compiles for half a minute and more; "
    "NUMBA_CACHE_DIR=FOLDER names a folder for it\n"
)

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Tuple = TypeVar("_Tuple", bound=NamedTuple)


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
    """Return the record of `parameters`, (1,): one pointer to hand to a kernel in place of many numbers and arrays."""
    return np.array([tuple(parameters)], dtype=_fields(parameters))


def opened(record: Packed, kind: type[_Tuple]) -> _Tuple:
    """Return the arrays of a record as the named tuple that was packed, in the record's memory."""
    return kind(*(record[name][0] for name in kind._fields))


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


def on_compile(report: Callable[[int], None]) -> None:
    """Call `report` with how many functions this process has compiled so far, as it begins each; none from disk."""
    register("numba:compile", _Compiling(report))  # type: ignore[no-untyped-call]


class _Compiling(Listener):
    def __init__(self, report: Callable[[int], None]) -> None:
        self._report = report
        self._begun = 0

    def on_start(self, _event: Event) -> None:
        self._begun += 1
        self._report(self._begun)

    def on_end(self, _event: Event) -> None:
        pass


def _kernel(function: Callable[..., Any]) -> Any:
    """Return the kernel of a function; numba by itself renews it with its own file only."""
    try:
        kernel: Any = njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # neither this file's folder nor the home can be written to
        if not _use_private_cache():
            return njit(error_model="numpy")(function)
        kernel = njit(cache=True, error_model="numpy")(function)
    on_disk = kernel._cache._cache_file  # noqa: SLF001
    # The version is compared before the rest is read, which fails where it names a type that has gone since.
    on_disk._version = on_disk._source_stamp = (__version__, *sorted(map(_hash, files_of(function))))  # noqa: SLF001
    return kernel


@cache
def _use_private_cache() -> bool:
    """Have this process and its children keep machine code in the private folder; return if they can."""
    folder = private_folder()
    if folder is not None:
        config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(folder)  # type: ignore[attr-defined]
    elif not os.environ.get(_SAID):
        os.environ[_SAID] = "1"
        sys.stderr.write(_NOWHERE)
    return folder is not None


def private_folder() -> Path | None:
    """Return a temporary folder of this user's, made where it is missing; None where it cannot be.

    What is kept there is run: nobody else may own the folder or write to it.
    """
    try:
        folder = Path(gettempdir()) / f"colibri-{os.getuid()}"
        folder.mkdir(0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return None
    private = S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return folder if private else None


@cache
def _hash(file: str) -> str:
    return sha256(Path(file).read_bytes()).hexdigest()
