"""Compiled kernels: what must hold of every one of them, so that no stale machine code ever flies."""

import importlib
import os
import pkgutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

from colibri import autopilot, common, mavlink, plant
from colibri.common.jit import files_of

MODULES = [
    importlib.import_module(entry.name)
    for package in (autopilot, common, mavlink, plant)
    for entry in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    if not entry.name.endswith("__main__")
]
KERNELS = {
    f"{kernel.py_func.__module__}.{kernel.py_func.__name__}": kernel
    for module in MODULES
    for kernel in vars(module).values()
    if isinstance(kernel, Dispatcher)
}
CALLER = """
from colibri.common.jit import compiled
from callee import doubled

@compiled
def quadrupled(x):
    return doubled(doubled(x))

if __name__ == "__main__":
    print(quadrupled(1.0), sum(quadrupled.stats.cache_hits.values()))
"""
CALLEE = """
from colibri.common.jit import compiled

@compiled
def doubled(x):
    return {factor} * x
"""


def test_there_are_kernels_on_both_sides() -> None:
    assert {
        "colibri.autopilot.control.lpv_mpc.prediction.respond",
        "colibri.plant.physics.equations.derivative",
        "colibri.common.elementary.sin",
    } <= set(KERNELS)


@pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)
def test_kernels_are_exact_and_kept_on_disk_and_call_others_by_name(kernel: Dispatcher) -> None:
    """By name and not through a module: so their files are known."""
    assert not kernel.targetoptions.get("fastmath", False)
    assert not isinstance(vars(kernel)["_cache"], NullCache)
    named = [kernel.py_func.__globals__.get(name) for name in kernel.py_func.__code__.co_names]
    assert {it.__name__ for it in named if isinstance(it, ModuleType)} <= {"numpy"}


def test_the_files_of_a_kernel_are_those_of_all_that_it_calls() -> None:
    names = {Path(file).name for file in files_of(KERNELS["colibri.plant.physics.integrators.runge_kutta_4"])}
    assert names == {"integrators.py", "equations.py", "rotations.py"}


def test_machine_code_is_renewed_with_a_kernel_that_it_calls(tmp_path: Path) -> None:
    def run(factor: float) -> str:
        (tmp_path / "callee.py").write_text(CALLEE.format(factor=factor))
        path = os.pathsep.join([str(tmp_path), str(Path(common.__path__[0]).parents[1])])
        environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_CACHE_DIR": ""}
        command = [sys.executable, str(tmp_path / "caller.py")]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    (tmp_path / "caller.py").write_text(CALLER)
    assert [run(2.0), run(2.0), run(3.0)] == ["4.0 0", "4.0 1", "9.0 0"]
