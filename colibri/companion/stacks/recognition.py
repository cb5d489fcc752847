"""Which stack flies a vehicle: by its HEARTBEAT and AUTOPILOT_VERSION, or as the user says."""

from colibri.companion.stacks.ardupilot import ARDUPILOT
from colibri.companion.stacks.colibri import COLIBRI
from colibri.companion.stacks.px4 import PX4
from colibri.companion.stacks.stack import Stack
from colibri.mavlink.services.identity import PRODUCT
from colibri.mavlink.wire.dialect import AUTOPILOT_GENERIC

STACKS: dict[str, Stack] = {stack.name: stack for stack in (PX4, ARDUPILOT, COLIBRI)}
_BY_AUTOPILOT = {PX4.autopilot: PX4, ARDUPILOT.autopilot: ARDUPILOT}


def recognised(autopilot: int, uid2: bytes) -> Stack | None:
    """Return the stack of a HEARTBEAT's `autopilot` and AUTOPILOT_VERSION's `uid2`; None for one that is not known."""
    if autopilot in (PX4.autopilot, AUTOPILOT_GENERIC) and uid2.startswith(PRODUCT):
        return COLIBRI
    return _BY_AUTOPILOT.get(autopilot)
