"""Control laws by the file or module that defines them: `my_law.py`, `my_law.py:PID`, `my_law:PID`, `policy.onnx`."""

import sys
from collections.abc import Mapping
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from colibri.autopilot.errors import AutopilotError
from colibri.common.errors import Error, unknown

POLICY = ".onnx"
_MEMBERS = ("initial", "step")
_provided: dict[str, tuple[str, Any]] = {}
_modules: dict[Path, tuple[int, ModuleType]] = {}  # loaded files, with the time of their last change


class LawFileError(AutopilotError):
    """A file or module without a usable control law."""


def is_place(name: str) -> bool:
    return name.endswith((".py", POLICY)) or ":" in name


def table_of(name: str) -> str:
    """Return the name of a law's table in a profile: for a file, that of its class."""
    return name.rpartition(":")[2]


def full_name(place: str) -> str:
    """Return a place with the name of its law, found if the file has only one."""
    if place in _provided:
        return _provided[place][0]
    if not place.endswith(".py"):
        return place
    laws = [name for name, value in vars(_module(place)).items() if _is_law(value, _module(place))]
    if not laws:
        raise LawFileError(f"controller {place}: the file has no control law, a class with initial() and step()")
    if len(laws) > 1:
        raise LawFileError(f"controller {place}: the file has {', '.join(laws)}: choose one, {place}:{laws[0]}")
    return f"{place}:{laws[0]}"


def law_at(place: str) -> Any:
    """Return the law at a full name; LawFileError if it cannot be loaded."""
    if place in _provided:
        return _provided[place][1]
    if place.endswith(POLICY):
        return import_module("colibri.autopilot.control.policy").OnnxFile.read(place)  # a law, as by an entry point
    where, _, name = place.rpartition(":")
    module = _module(where)
    if not hasattr(module, name):
        laws = [each for each, value in vars(module).items() if _is_law(value, module)]
        raise LawFileError(f"controller {where}: {unknown('name', name, laws)}")
    return getattr(module, name)


def provide(laws: Mapping[str, Any]) -> None:
    """Use laws in place of the files of their places, which this computer may not have; full names are keys, too."""
    _provided.update({key: (name, law) for place, (name, law) in laws.items() for key in (place, name)})


def _is_law(value: object, module: ModuleType) -> bool:
    its = isinstance(value, type) and value.__module__ == module.__name__
    return its and all(callable(getattr(value, name, None)) for name in _MEMBERS)


def _module(where: str) -> ModuleType:
    path = Path(where if where.endswith(".py") else f"{where.replace('.', '/')}.py")
    try:
        if where.endswith(".py") or path.is_file():
            return _of_file(path.resolve())
        return import_module(where)
    except Error:
        raise
    except OSError as error:
        raise LawFileError(f"controller {where}: {error.strerror}") from error
    except SyntaxError as error:
        raise LawFileError(f"controller {where}: line {error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        words = " ".join(str(error).split())
        raise LawFileError(f"controller {where} cannot be loaded: {type(error).__name__}: {words}") from error


def _of_file(path: Path) -> ModuleType:
    changed = path.stat().st_mtime_ns
    if path in _modules and _modules[path][0] == changed:
        return _modules[path][1]
    _, before = _modules.get(path, (0, None))
    free = sys.modules.get(path.stem) in (None, before) and path.stem not in sys.builtin_module_names
    name = path.stem if free else f"law_{path.stem}"  # an imported module stays, for its classes to be pickled
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    _modules[path] = changed, module
    return module
