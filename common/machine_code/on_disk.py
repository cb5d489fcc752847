"""Machine code as numba's dispatcher asks for it: from a folder, renewed when a file that it is made of changes."""

import os
import sys
from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

import llvmlite
import numba
from numba.core import config
from numba.core.caching import FunctionCache, NullCache

from colibri.common.machine_code import results
from colibri.common.machine_code.private_folder import private_folder
from colibri.common.machine_code.sources import files_of, hash_of

_SAID = "COLIBRI_SAID_UNCACHED"
_NOWHERE = (
    "colibri: machine code can be kept nowhere, so each start compiles for half a minute and more; "
    "NUMBA_CACHE_DIR=FOLDER names a folder for it\n"
)


class MachineCode:
    """The machine code of one kernel. Its folder is looked for when it is first asked for.

    For most kernels it never is: they are part of the machine code of those that call them.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        """Keep the machine code of `function`."""
        self._function = function

    @property
    def cache_path(self) -> str | None:
        """Return the folder; None where it is kept nowhere."""
        folder: str | None = self._cache.cache_path
        return folder

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what compiling for a signature has given; None where it has not been done, or from other files."""
        return self._cache.load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what compiling for a signature has given."""
        self._cache.save_overload(sig, data)

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

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


@cache
def _use_private_folder() -> bool:
    """Have this process and its children keep machine code in the private folder; return if they can."""
    folder = private_folder()
    if folder is not None:
        config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(folder)  # type: ignore[attr-defined]
    elif not os.environ.get(_SAID):
        os.environ[_SAID] = "1"
        sys.stderr.write(_NOWHERE)
    return folder is not None
