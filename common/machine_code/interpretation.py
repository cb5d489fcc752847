"""Interpret kernels that another process is compiling, where their result is not worth the wait."""

from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher

from colibri.common.machine_code import on_disk


class _CompiledElsewhereError(Exception): ...


class _Calls:
    """Calls of kernels; what a kernel itself calls is interpreted with it."""

    def __init__(self) -> None:
        self._call: Any = CPUDispatcher.__call__
        self._called: Any = None
        self._interprets = False

    def call(self, kernel: Any, *args: Any) -> Any:
        if self._interprets:
            return kernel.py_func(*args)
        self._called = kernel
        try:
            return self._call(kernel, *args)
        except _CompiledElsewhereError:
            self._interprets = True
        finally:
            self._called = None
        try:
            with np.errstate(all="ignore"):  # as the machine code
                return kernel.py_func(*map(_with_attributes, args))
        except Exception:  # what Python rejects, as a division by zero: then the compiled one
            return self._call(kernel, *args)
        finally:
            self._interprets = False

    def on_wait(self) -> None:
        """Raise instead of waiting for the kernel that was called; wait for those that a compilation needs."""
        if self._called is not None and not self._called._cache.is_compiling:  # noqa: SLF001
            raise _CompiledElsewhereError


def interpret_while_waiting() -> None:
    """Share the compilation of kernels with the processes that fly the same flight."""
    calls = _Calls()
    CPUDispatcher.__call__ = lambda kernel, *args: calls.call(kernel, *args)  # type: ignore[assignment,method-assign]
    on_disk.waiting.append(calls.on_wait)


def _with_attributes(value: Any) -> Any:
    """Return an argument with the fields of records as attributes, sharing its memory."""
    if isinstance(value, np.ndarray) and value.dtype.names:
        return value.view(np.recarray)
    if isinstance(value, np.void):
        return value.view(np.dtype((np.record, value.dtype)))
    if isinstance(value, tuple):
        parts = map(_with_attributes, value)
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    return value
