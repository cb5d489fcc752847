"""Recognition of a vehicle's stack by HEARTBEAT and AUTOPILOT_VERSION."""

from colibri.companion.stacks.ardupilot import ARDUPILOT
from colibri.companion.stacks.colibri import COLIBRI
from colibri.companion.stacks.px4 import PX4
from colibri.companion.stacks.stack import Stack
from colibri.mavlink.services.identity import PRODUCT
from colibri.mavlink.wire.dialect import AUTOPILOT_GENERIC

STACKS: dict[str, Stack] = {stack.name: stack for stack in (PX4, ARDUPILOT, COLIBRI)}
_BY_AUTOPILOT = {PX4.autopilot: PX4, ARDUPILOT.autopilot: ARDUPILOT}


def recognised(autopilot: int, uid2: bytes) -> Stack | None:
    """Return the stack of a HEARTBEAT's `autopilot` and an AUTOPILOT_VERSION's `uid2`, if it is known."""
    if autopilot in (PX4.autopilot, AUTOPILOT_GENERIC) and uid2.startswith(PRODUCT):
        return COLIBRI
    return _BY_AUTOPILOT.get(autopilot)
