"""Compiled kernels: what must hold of every one of them, so that no stale machine code ever flies."""

import importlib
import os
import pkgutil
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import float64, typeof
from numba.core.dispatcher import Dispatcher
from numba.core.event import Event, Listener, install_listener
from numba.core.registry import CPUDispatcher

from colibri import autopilot, common, mavlink, plant
from colibri.common.machine_code import on_disk
from colibri.common.machine_code.content import fields_of, functions_of, key_of
from colibri.common.machine_code.interpretation import interpret_while_waiting
from colibri.common.machine_code.turns import Turn
from colibri.experiments.flight import fly

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
from callee import {argument}, doubled

@compiled
def quadrupled(x):
    return doubled(doubled(x.value))

if __name__ == "__main__":
    print(quadrupled({argument}(1.0)), sum(quadrupled.stats.cache_hits.values()))
"""
CALLEE = """
from typing import NamedTuple

from colibri.common.jit import compiled

class {argument}(NamedTuple):
    value: float

@compiled
def doubled(x):
    return {factor} * x
"""


def test_there_are_kernels_on_both_sides() -> None:
    assert {
        "colibri.autopilot.control.lpv_mpc.deviations.respond",
        "colibri.plant.physics.equations.write_derivative",
        "colibri.common.elementary.sin",
    } <= set(KERNELS)


@pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)
def test_kernels_are_exact_and_cached_on_disk(kernel: Dispatcher) -> None:
    """By name and not through a module: so their files are known."""
    assert not kernel.targetoptions.get("fastmath", False)
    assert kernel.stats.cache_path is not None
    named = [kernel.py_func.__globals__.get(name) for name in kernel.py_func.__code__.co_names]
    assert {it.__name__ for it in named if isinstance(it, ModuleType)} <= {"numpy"}


def test_no_kernel_assigns_whole_arrays() -> None:
    """`out[:] = values` takes seconds to compile, most for the text of an error of shapes: see `matrices.put`."""
    fly("spiral", feedback="sensors", turbulence="light", duration=3.0)
    flown: list[tuple[str, Any]] = [(name, it) for name, kernel in KERNELS.items() for it in kernel.overloads.values()]
    codes = {name: made.library._get_module_for_linking().as_bitcode() for name, made in flown}  # noqa: SLF001
    assert {"colibri.plant.physics.frames.fixed_frames", "colibri.autopilot.estimation.eskf_predict.predict"} < {*codes}
    assert [name for name, code in codes.items() if b"raise_with_shape_context" in code] == []


def test_the_files_of_a_kernel_are_those_of_all_that_it_calls() -> None:
    functions = functions_of(KERNELS["colibri.plant.physics.integrators.runge_kutta_4"])
    names = {Path(it.__code__.co_filename).name for it in functions}
    assert names == {"integrators.py", "equations.py", "matrices.py", "rotations.py"}


KEYED = """
from elsewhere import LIMIT, Pair, TABLE
from numba import njit

@njit(error_model="numpy")
def inner(x):
    return x + 1.0

def made(factor):
    @njit(error_model="numpy")
    def kernel(x, by=2.0):
        return Pair(inner(x) * LIMIT, [TABLE[1] * by for _ in range(3)][0]).first * factor
    return kernel
"""
ELSEWHERE = """
from typing import NamedTuple
import numpy as np

class Pair(NamedTuple):
    first: float
    second: float

LIMIT = 3.0
TABLE = np.array([1.0, 2.0])
"""


class KeyedPair(NamedTuple):
    value: float
    weight: float


def _key(folder: Path, monkeypatch: pytest.MonkeyPatch, keyed: str, elsewhere: str, factor: float) -> str:
    folder.mkdir(parents=True)
    (folder / "keyed.py").write_text(keyed)
    (folder / "elsewhere.py").write_text(elsewhere)
    monkeypatch.syspath_prepend(folder)
    for name in ("keyed", "elsewhere"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return key_of(importlib.import_module("keyed").made(factor))


def test_the_key_of_machine_code_is_its_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = {
        "same": (KEYED, ELSEWHERE, 1.0),
        "same, at another path": (KEYED, ELSEWHERE, 1.0),
        "source": (KEYED.replace("x + 1.0", "x + 2.0"), ELSEWHERE, 1.0),
        "option": (KEYED.replace("numpy", "python"), ELSEWHERE, 1.0),
        "closure": (KEYED, ELSEWHERE, 2.0),
        "constant elsewhere": (KEYED, ELSEWHERE.replace("3.0", "4.0"), 1.0),
        "array elsewhere": (KEYED, ELSEWHERE.replace("1.0, 2.0", "1.0, 3.0"), 1.0),
        "fields elsewhere": (KEYED, ELSEWHERE.replace("first", "third"), 1.0),
    }
    keys = [_key(tmp_path / str(n), monkeypatch, *case) for n, case in enumerate(cases.values())]
    assert keys[0] == keys[1]
    assert len(set(keys)) == len(cases) - 1
    argument = typeof(KeyedPair(1.0, 2.0))  # type: ignore[no-untyped-call]
    assert fields_of((argument, float64)) == ((("value", "weight"), ()),)


def _run(folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(folder), str(Path(common.__path__[0]).parents[1])])
    cache = {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": str(folder / "cache")}
    usual = {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", **cache}
    command = [sys.executable, str(folder / "caller.py"), *words]
    done = {**os.environ, **usual, **environment}
    return subprocess.run(command, env=done, capture_output=True, text=True, check=True)


def _write(folder: Path, factor: float, argument: str = "Number") -> None:
    (folder / "callee.py").write_text(CALLEE.format(factor=factor, argument=argument))
    (folder / "caller.py").write_text(CALLER.format(argument=argument))


@pytest.mark.long
def test_machine_code_is_renewed_with_callees_and_types(tmp_path: Path) -> None:
    said = []
    for factor, argument in ((2.0, "Number"), (2.0, "Number"), (3.0, "Number"), (3.0, "Length")):
        _write(tmp_path, factor, argument)
        said.append(_run(tmp_path).stdout.strip())
    assert said == ["4.0 0", "4.0 1", "9.0 0", "9.0 0"]


@pytest.mark.long
@pytest.mark.parametrize("trusted", [True, False], ids=["private", "open to others"])
def test_machine_code_needs_a_private_writable_folder(tmp_path: Path, *, trusted: bool) -> None:
    _write(tmp_path, 2.0)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    private = temporary / f"colibri-{os.getuid()}"
    if not trusted:
        private.mkdir()
        private.chmod(0o777)
    nowhere = {"HOME": os.devnull, "XDG_CACHE_HOME": os.devnull, "TMPDIR": str(temporary)}
    first, second = (_run(tmp_path, **nowhere) for _ in range(2))
    assert [first.stdout, second.stdout] == (["4.0 0\n", "4.0 1\n"] if trusted else ["4.0 0\n"] * 2)
    assert private.stat().st_mode & 0o777 == (0o700 if trusted else 0o777)
    assert ("NUMBA_CACHE_DIR" in first.stderr) is not trusted
    assert len(first.stderr.splitlines()) == (0 if trusted else 1)


class _Interrupts(Listener):
    def on_start(self, _event: Event) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    def on_end(self, _event: Event) -> None: ...


def _unseen(folder: Path, monkeypatch: pytest.MonkeyPatch, result: str = "3.0 * x") -> Any:
    """Return a kernel that is not compiled yet."""
    text = f"from colibri.common.jit import compiled\n\n@compiled\ndef computed(x):\n    return {result}\n"
    (folder / "unseen.py").write_text(text)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "unseen", raising=False)
    monkeypatch.setattr(on_disk, "folders", lambda: [folder / "cache"])
    return importlib.import_module("unseen").computed


def test_an_interrupt_is_raised_after_compilation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = _unseen(tmp_path, monkeypatch)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a command of an earlier test may have its own
    try:
        with install_listener("numba:compile", _Interrupts()), pytest.raises(KeyboardInterrupt):
            kernel(1.0)
    finally:
        signal.signal(signal.SIGINT, before)
    assert list(tmp_path.rglob("*.nbc")), "it is on disk"
    assert kernel(2.0) == 6.0
    assert signal.getsignal(signal.SIGINT) is before


def test_one_process_compiles_while_others_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = _unseen(tmp_path, monkeypatch)
    other = Turn(kernel._cache.lock_file(), lambda: None)  # noqa: SLF001
    said: list[str] = []
    monkeypatch.setattr(on_disk, "waiting", [lambda: said.append("waiting"), other.end])
    assert kernel(1.0) == 3.0
    assert said == ["waiting"]


def test_a_kernel_is_interpreted_while_another_compiles_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = _unseen(tmp_path, monkeypatch, "1.0 / x[0].value")
    monkeypatch.setattr(on_disk, "waiting", [])
    monkeypatch.setattr(CPUDispatcher, "__call__", CPUDispatcher.__call__)  # restored by monkeypatch
    argument = np.array([(0.0,)], dtype=[("value", "f8")])
    interpret_while_waiting()
    other = Turn(kernel._cache.lock_file(), lambda: None)  # noqa: SLF001
    assert kernel(argument) == np.inf
    assert not kernel.signatures
    other.end()
    assert kernel(argument) == np.inf
    assert len(kernel.signatures) == 1


def test_kernels_of_a_read_only_folder_are_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image, other = tmp_path / "cache", tmp_path / "other"
    assert _unseen(tmp_path, monkeypatch)(1.0) == 3.0
    monkeypatch.setattr(on_disk, "folders", lambda: [image, other])
    monkeypatch.setattr(on_disk, "_can_be_written", lambda folder: folder == other)
    monkeypatch.delitem(sys.modules, "unseen")
    kernel = importlib.import_module("unseen").computed
    other.mkdir()
    assert kernel(2.0) == 6.0
    assert sum(kernel.stats.cache_hits.values()) == 1
    assert not list(other.iterdir())


def test_versions_of_a_kernel_unused_for_months_are_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("computed-0.1.nbc", "computed-1.1.nbc", "other-0.1.nbc")
    old, recent, another = (tmp_path / "cache" / f"unseen.{name}" for name in names)
    for file in (old, recent, another):
        file.parent.mkdir(exist_ok=True)
        file.touch()
    for file in (old, another):
        os.utime(file, (1e9, 1e9))
    _unseen(tmp_path, monkeypatch)(1.0)
    assert [file.exists() for file in (old, recent, another)] == [False, True, True]


def test_folders_of_an_unknown_or_closed_home_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_disk, "user_cache_dir", lambda *_: "~/.cache/colibri")  # the home is unknown
    assert "~" not in str(on_disk.folders.__wrapped__())
    monkeypatch.setattr(on_disk, "folders", lambda: [Path("x" * 300)])  # looking there fails for root, too
    assert not on_disk.read_only_folders()
