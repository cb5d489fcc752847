"""PX4's conventions, which are Colibri's own."""

from colibri.autopilot.ground.conventions import Conventions
from colibri.mavlink.services.identity import PX4

CONVENTIONS = Conventions(wire=PX4)
