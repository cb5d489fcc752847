"""numba's cache of machine code in a folder, renewed when a source file changes."""

import os
import sys
from collections.abc import Callable
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from types import FunctionType
from typing import Any

import llvmlite
import numba
from numba.core import config
from numba.core.caching import FunctionCache, NullCache

from colibri.common.machine_code import results
from colibri.common.machine_code.private_folder import private_folder
from colibri.common.machine_code.turns import Turn

_SAID = "COLIBRI_SAID_UNCACHED"
_NOWHERE = (
    "colibri: machine code can be kept nowhere, so each start compiles for half a minute and more; "
    "NUMBA_CACHE_DIR=FOLDER names a folder for it\n"
)


class MachineCode:
    """The machine code of one kernel, located on first use: most kernels are part of their callers' code."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._turns: list[Turn] = []

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load machine code; without any, wait for a process that compiles it, or take the turn to do so."""
        found = self._cache.load_overload(sig, target_context)
        if found is None and isinstance(self._cache, _OnDisk):
            turn = Turn(self._cache.lock_file(), _report_waiting)
            self._turns.append(turn)
            found = self._cache.load_overload(sig, target_context)
            if found is None:
                turn.hold_signals()
        return found

    def in_turn(self, compile_for: Callable[[Any], Any]) -> Callable[[Any], Any]:
        """Return `compile_for` that ends the turns it has taken."""

        def compile_in_turn(sig: Any) -> Any:
            turns = len(self._turns)
            try:
                return compile_for(sig)
            finally:
                while len(self._turns) > turns:
                    self._turns.pop().end()

        return compile_in_turn

    @property
    def is_compiling(self) -> bool:
        return bool(self._turns)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    @cached_property
    def _cache(self) -> Any:
        try:
            return _OnDisk(self._function)
        except RuntimeError:  # neither the folder of its file nor the home can be written to
            return _OnDisk(self._function) if _use_private_folder() else NullCache()


class _OnDisk(FunctionCache):
    _impl_class = results.Results

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        files = map(hash_of, files_of(function) | {results.__file__})
        # The version is compared before the rest is read, which fails where it names a type that has gone since.
        version = (numba.__version__, llvmlite.__version__, *sorted(files))
        self._cache_file._version = self._cache_file._source_stamp = self._impl.version = version  # noqa: SLF001

    def lock_file(self) -> Path:
        """Return the file that is locked during compilation."""
        self._impl.locator.ensure_cache_path()
        return Path(self._cache_file._index_path).with_suffix(".lock")  # noqa: SLF001

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


waiting: list[Callable[[], object]] = []
"""Called before this process waits for another that compiles; what they raise ends the call instead."""


def _report_waiting() -> None:
    for report in waiting:
        report()


@cache
def _use_private_folder() -> bool:
    folder = private_folder()
    if folder is not None:
        config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(folder)  # type: ignore[attr-defined]
    elif not os.environ.get(_SAID):
        os.environ[_SAID] = "1"
        sys.stderr.write(_NOWHERE)
    return folder is not None


def files_of(function: Callable[..., Any]) -> set[str]:
    """Return the files of a function and of the functions it calls by global name."""
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


@cache
def hash_of(file: str) -> str:
    return sha256(Path(file).read_bytes()).hexdigest()
