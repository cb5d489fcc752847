"""The identities towards ground stations; one with conventions of its own has a file, loaded when flown."""

from importlib import import_module

from colibri.autopilot.ground.conventions import Conventions
from colibri.mavlink.services.identity import GENERIC, PX4

_PLAIN = {identity.name: Conventions(wire=identity) for identity in (PX4, GENERIC)}
"""Those with Colibri's own conventions, which are PX4's."""


def conventions_of(name: str) -> Conventions:
    """Return an identity's conventions: `CONVENTIONS` in the file of its name, if it has one."""
    return _PLAIN.get(name) or import_module(f"{__name__}.{name}").CONVENTIONS
