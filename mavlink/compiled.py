"""Numerical kernels: how they are compiled, and the rotations of `frames` for use inside them."""

from collections.abc import Callable
from typing import Any, Protocol, TypeVar, cast

from numba import njit

from mavlink import frames

_Function = TypeVar("_Function", bound=Callable[..., Any])


class _Decorator(Protocol):
    def __call__(self, function: _Function, /) -> _Function: ...


compiled = cast(_Decorator, njit(cache=True, error_model="numpy"))
"""Compile a function at its first call, and keep the machine code on disk for every later process.

The disk's copy is renewed when the function's own file changes, and only then: so a kernel calls no other file's.

Arithmetic stays IEEE 754's in the order written, so that a kernel gives the same bits on every run; division by zero
gives an infinity, as in numpy.
"""

rotation_matrix = compiled(frames.rotation_matrix)
