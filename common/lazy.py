"""Public names of a package, imported on first access."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from sys import modules
from typing import Any


def public(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return a package's `__getattr__` and `__dir__` of the names that it imports under `if TYPE_CHECKING:`."""

    @cache
    def places() -> dict[str, str]:
        import ast

        tree = ast.parse(Path(modules[package].__file__ or "").read_text(encoding="utf-8"))
        (checked,) = (node for node in tree.body if isinstance(node, ast.If))
        imports = (node for node in checked.body if isinstance(node, ast.ImportFrom))
        return {alias.name: str(node.module) for node in imports for alias in node.names}

    def get(name: str) -> Any:
        if name[:1] != "_" and name not in places() and (Path(modules[package].__path__[0]) / name).is_dir():
            return import_module(f"{package}.{name}")  # a package within, `colibri.lpv` say
        if name != "__all__" and name not in places():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = sorted(places()) if name == "__all__" else getattr(import_module(places()[name]), name)
        setattr(modules[package], name, value)
        return value

    return get, lambda: sorted({*vars(modules[package]), *places()})
