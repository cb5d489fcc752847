"""The identities towards ground stations, one file each; a further one needs a file and a line here."""

from colibri.autopilot.ground.conventions import Conventions
from colibri.autopilot.identities.ardupilot import ARDUPILOT
from colibri.mavlink.services.identity import GENERIC, PX4

CONVENTIONS = {each.wire.name: each for each in (Conventions(wire=PX4), ARDUPILOT, Conventions(wire=GENERIC))}
