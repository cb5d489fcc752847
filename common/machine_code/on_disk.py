"""numba's cache of machine code in the user's cache folder, by content."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

from numba.core import config
from numba.core.caching import FunctionCache, NullCache
from numba.misc.appdirs import user_cache_dir

from colibri.common.machine_code import results
from colibri.common.machine_code.content import fields_of, key_of
from colibri.common.machine_code.private_folder import private_folder
from colibri.common.machine_code.turns import Turn

_SAID = "COLIBRI_SAID_UNCACHED"
_NOWHERE = (
    "colibri: machine code can be kept nowhere, so each start compiles for half a minute and more; "
    "NUMBA_CACHE_DIR=FOLDER names a folder for it\n"
)
_KEPT_UNUSED_S = 60 * 86400.0


class MachineCode:
    """The machine code of one kernel, located on first use: most is part of the callers' code."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._turns: list[Turn] = []

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load machine code; without any, wait for a process that compiles it, or take the turn."""
        for kept in (self._cache, *self._read_only):
            found = kept.load_overload(sig, target_context)
            if found is not None:
                return found
        if not isinstance(self._cache, _OnDisk):
            return None
        turn = Turn(self._cache.lock_file(), _report_waiting)
        self._turns.append(turn)
        found = self._cache.load_overload(sig, target_context)
        if found is None:
            turn.hold_signals()
        return found

    def in_turn(self, compile_for: Callable[[Any], Any]) -> Callable[[Any], Any]:
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
        folder = folder_to_write()
        if folder is None:
            _report_nowhere()
        return NullCache() if folder is None else self._within(folder)

    @cached_property
    def _read_only(self) -> list[Any]:
        return [self._within(folder) for folder in read_only_folders()]

    def _within(self, folder: Path) -> Any:
        try:
            return _OnDisk(self._kernel.py_func, folder, key_of(self._kernel))
        except OSError:  # its source is not known
            return NullCache()


class _OnDisk(FunctionCache):
    def __init__(self, function: Callable[..., Any], folder: Path, key: str) -> None:
        self._impl_class = partial(results.Results, folder=folder, key=key)  # type: ignore[assignment]
        super().__init__(function)

    def lock_file(self) -> Path:
        return Path(self._cache_file._index_path).with_suffix(".lock")  # noqa: SLF001

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return self._load_overload(sig, target_context)
        except (AttributeError, ImportError):  # it names a type that has gone since
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        super().save_overload(sig, data)
        with suppress(OSError):  # another process may delete them, too
            self._impl.drop_unused(_KEPT_UNUSED_S)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (*super()._index_key(sig, codegen), fields_of(sig))


waiting: list[Callable[[], object]] = []  # called before this process waits for another; may raise


def _report_waiting() -> None:
    for report in waiting:
        report()


def _report_nowhere() -> None:
    if not read_only_folders() and not os.environ.get(_SAID):
        os.environ[_SAID] = "1"
        sys.stderr.write(_NOWHERE)


@cache
def folders() -> list[Path]:
    """Return the folders for machine code, the best first."""
    named = [Path(config.CACHE_DIR)] if config.CACHE_DIR else []  # type: ignore[attr-defined]
    usual = Path(user_cache_dir("colibri", False))  # below "~" if the home is unknown
    return [*named, *(it / "kernels" for it in (usual, private_folder()) if it and it.is_absolute())]


def folder_to_write() -> Path | None:
    return next(filter(_can_be_written, folders()), None)


def read_only_folders() -> list[Path]:
    return [folder for folder in folders() if os.access(folder, os.R_OK | os.X_OK) and not _can_be_written(folder)]


@cache
def _can_be_written(folder: Path) -> bool:
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.R_OK | os.W_OK | os.X_OK)
