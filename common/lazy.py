"""The public face of a package: names that are imported when they are first asked for, since most never are."""

from collections.abc import Callable, Mapping
from importlib import import_module
from sys import modules
from typing import Any


def public(package: str, places: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return a package's `__getattr__` and `__dir__`; `places` has the names of each module, parted by blanks."""
    place_of = {name: place for place, names in places.items() for name in names.split()}

    def get(name: str) -> Any:
        if name not in place_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(place_of[name]), name)
        setattr(modules[package], name, value)
        return value

    return get, lambda: sorted({*vars(modules[package]), *place_of})
