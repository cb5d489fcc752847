"""The public face of a package: names that are imported when they are first asked for, since most never are."""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from sys import modules
from typing import Any


def public(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and the `__dir__` of a package.

    What is public, and so in the `__all__` of `package`, is what its `__init__.py` imports under `if TYPE_CHECKING:`,
    for type checkers. It is read from there when the first name is asked for.
    """

    @cache
    def places() -> dict[str, str]:
        """Return the module of each public name."""
        import ast

        tree = ast.parse(Path(modules[package].__file__ or "").read_text(encoding="utf-8"))
        (checked,) = (node for node in tree.body if isinstance(node, ast.If))
        imports = (node for node in checked.body if isinstance(node, ast.ImportFrom))
        return {alias.name: str(node.module) for node in imports for alias in node.names}

    def get(name: str) -> Any:
        if name != "__all__" and name not in places():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = sorted(places()) if name == "__all__" else getattr(import_module(places()[name]), name)
        setattr(modules[package], name, value)
        return value

    return get, lambda: sorted({*vars(modules[package]), *places()})
