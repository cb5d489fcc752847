"""The identities towards ground stations, one file each; only the one that is flown is loaded."""

from importlib import import_module

from colibri.autopilot.ground.conventions import Conventions


def conventions_of(name: str) -> Conventions:
    """Return the conventions of an identity: `CONVENTIONS` in the file of its name."""
    found: Conventions = import_module(f"{__name__}.{name}").CONVENTIONS
    return found
