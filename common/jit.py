"""Compilation of numerical kernels."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np
from llvmlite.binding import ffi
from numba import config, njit
from numba.core.event import Event, Listener, register
from numpy.typing import NDArray

from colibri.common.errors import Error
from colibri.common.machine_code.on_disk import MachineCode, waiting

if config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise Error("NUMBA_DISABLE_JIT must be unset: kernels are compiled")

Packed: TypeAlias = NDArray[np.void]

# numba times each of its calls of LLVM; nobody reads these times, and they take a twentieth of a compilation.
getattr(getattr(ffi.lib, "_lock", None), "_cblist", []).clear()

_LINE = 64  # bytes of a cache line
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}  # C calls no kernel: compiled sooner

_Numbers: TypeAlias = tuple[np.dtype[Any], tuple[int, ...]]
_Form: TypeAlias = tuple[tuple[str, ...], tuple[Any, ...]]
"""Names of fields, and for each its `_Form` or `_Numbers`."""
_FLOAT: _Numbers = (np.dtype(np.float64), ())

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Tuple = TypeVar("_Tuple", bound=NamedTuple)


def compiled(function: _Function) -> _Function:
    """Compile a function at its first call, and cache the machine code on disk until a source changes.

    Arithmetic is IEEE 754 in the order written; division by zero gives infinity.
    """
    return cast(_Function, _kernel(function))


def inlined(function: _Function) -> _Function:
    """Compile a function into its callers, where array shapes are constants and loops are vectorised."""
    return cast(_Function, _kernel(function, forceinline=True))


def noalias(function: _Function) -> _Function:
    """Compile as `inlined` a function whose arrays share no memory: its loops are vectorised without asking for it."""
    kernel = _kernel(function, forceinline=True)
    kernel._compiler._customize_flags = _without_alias  # noqa: SLF001
    return cast(_Function, kernel)


def _without_alias(flags: Any) -> Any:
    flags.noalias = True
    return flags


def without_gil(function: _Function) -> _Function:
    return cast(_Function, _kernel(function, nogil=True))


def compiled_for(*signatures: str) -> Callable[[_Function], _Function]:
    """Compile at once for these argument types alone; other arguments are converted."""

    def compiled_now(function: _Function) -> _Function:
        kernel = _kernel(function)
        for signature in signatures:
            kernel.compile(signature)
        kernel.disable_compile()
        return cast(_Function, kernel)

    return compiled_now


def packed(parameters: NamedTuple) -> Packed:
    """Return the record of `parameters`, (1,), a kernel's argument, aligned to cache lines."""
    layout = _layout(*_form(parameters))
    memory = np.zeros(layout.itemsize + _LINE, dtype=np.uint8)
    begin = -memory.ctypes.data % _LINE
    record = memory[begin : begin + layout.itemsize].view(layout)
    record[0] = tuple(parameters)
    return record


def opened(record: Packed, kind: type[_Tuple]) -> _Tuple:
    """Return a record's arrays as the named tuple that was packed, sharing its memory."""
    return kind._make(_opened(record[name]) for name in kind._fields)


def _opened(field: Packed) -> Any:
    names = field.dtype.names
    return field[0] if names is None else tuple(_opened(field[name]) for name in names)


def _form(parameters: Any) -> _Form:
    return parameters._fields, tuple([_part(value) for value in parameters])


def _part(value: Any) -> _Form | _Numbers:
    if isinstance(value, float):
        return _FLOAT
    if hasattr(value, "_fields"):
        return _form(value)
    return np.dtype(getattr(value, "dtype", np.float64)), np.shape(value)


@cache
def _layout(names: tuple[str, ...], parts: tuple[Any, ...]) -> np.dtype[np.void]:
    """Return one type for all records of a form: kernels recognise it three times as fast as a copy."""
    formats, offsets, end = [], [], 0
    for part in parts:
        whole = np.dtype(part) if isinstance(part[0], np.dtype) else _layout(*part)
        unit = _LINE if whole.itemsize >= _LINE else whole.base.alignment
        offsets.append(-(-end // unit) * unit)
        formats.append(whole)
        end = offsets[-1] + whole.itemsize
    return np.dtype({"names": names, "formats": formats, "offsets": offsets})


def on_compile(report: Callable[[int], None]) -> None:
    """Report the number of functions compiled so far as each compilation begins, here or elsewhere."""
    compiling = _Compiling(report)
    register("numba:compile", compiling)  # type: ignore[no-untyped-call]
    waiting.append(compiling.on_wait)


class _Compiling(Listener):
    def __init__(self, report: Callable[[int], None]) -> None:
        self._report = report
        self._begun = 0

    def on_start(self, _event: Event) -> None:
        self._begun += 1
        self._report(self._begun)

    def on_wait(self) -> None:
        if not self._begun:
            self._begun = 1
            self._report(1)

    def on_end(self, _event: Event) -> None:
        pass


def _kernel(function: Callable[..., Any], **options: Any) -> Any:
    kernel: Any = njit(**_OPTIONS, **options)(function)
    machine_code = kernel._cache = MachineCode(kernel)  # noqa: SLF001
    kernel.compile = machine_code.in_turn(kernel.compile)
    return kernel
