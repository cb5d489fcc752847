"""Compiled kernels: what must hold of every one of them, so that no stale machine code ever flies."""

import importlib
import pkgutil
from types import ModuleType

import pytest
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

import autopilot
import mavlink
import plant


def kernels(module: ModuleType) -> dict[str, Dispatcher]:
    return {name: value for name, value in vars(module).items() if isinstance(value, Dispatcher)}


MODULES = [
    importlib.import_module(f"{package.__name__}.{entry.name}")
    for package in (autopilot, mavlink, plant)
    for entry in pkgutil.iter_modules(package.__path__)
    if entry.name != "__main__"
]
SETTLED = {"rotation_matrix"}
"""A formula that does not change any more."""
WITH_KERNELS = [module for module in MODULES if kernels(module)]


def test_there_are_kernels_on_both_sides() -> None:
    assert {"autopilot.prediction", "plant.dynamics"} <= {module.__name__ for module in WITH_KERNELS}


@pytest.mark.parametrize("module", WITH_KERNELS, ids=lambda module: module.__name__)
def test_kernels_stay_in_their_file_and_are_kept_on_disk(module: ModuleType) -> None:
    """The disk's copy is renewed when a kernel's own file changes: it may not hold code of another."""
    everywhere = kernels(module)
    for name, kernel in everywhere.items():
        assert not kernel.targetoptions.get("fastmath", False), name
        assert not isinstance(vars(kernel)["_cache"], NullCache), name
        called = set(kernel.py_func.__code__.co_names) & (set(everywhere) - SETTLED)
        assert {everywhere[other].py_func.__module__ for other in called} <= {kernel.py_func.__module__}, name
