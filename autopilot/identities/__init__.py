"""The identities towards ground stations, a file each, loaded when flown."""

from importlib import import_module

from colibri.autopilot.ground.conventions import Conventions


def conventions_of(name: str) -> Conventions:
    """Return `CONVENTIONS` in the file of an identity's name."""
    found: Conventions = import_module(f"{__name__}.{name}").CONVENTIONS
    return found
