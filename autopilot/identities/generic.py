"""Colibri's conventions without a program that clients know."""

from colibri.autopilot.ground.conventions import Conventions
from colibri.mavlink.services.identity import GENERIC

CONVENTIONS = Conventions(wire=GENERIC)
