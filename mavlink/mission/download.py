"""Downloads of plans: every request is answered, any number at once.

Specification: https://mavlink.io/en/services/mission.html, "Download a Mission from the Vehicle". The vehicle only
answers. It remembers which plan it has announced to whom, so that nobody receives the first half of one plan and the
second half of the one that replaced it meanwhile.
"""

from typing import NamedTuple

from colibri.mavlink.mission.items import NO_PLAN, Plan, item_fields
from colibri.mavlink.mission.upload import ack
from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.wire.dialect import mav

FORGOTTEN_AFTER_US = 5_000_000
"""A reader that requests nothing so long is sent the newest plan after."""
MAX_READERS = 32


class _Reading(NamedTuple):
    """What a ground station is reading."""

    plan: Plan
    received_us: int


class Downloads:
    """Answers MISSION_REQUEST_LIST, MISSION_REQUEST_INT and MISSION_REQUEST."""

    def __init__(self) -> None:
        """Begin with no reader."""
        self._readings: dict[tuple[Peer, int], _Reading] = {}

    def begin(self, peer: Peer, plan_type: int, plan: Plan, now_us: int) -> Send:
        """Announce `plan`."""
        self._remember(peer, plan_type, plan, now_us)
        target = (peer.system, peer.component)
        return to(peer, "MISSION_COUNT", *target, len(plan.items), plan_type, plan.id)

    def item(self, peer: Peer, plan_type: int, seq: int, newest: Plan, current: int, now_us: int) -> Send:
        """Return an item of the plan that was announced, or of the newest; `current` is the one being flown of that.

        MISSION_REQUEST, too, is answered by a MISSION_ITEM_INT: "Deprecated Types: MISSION_ITEM".
        """
        reading = self._readings.get((peer, plan_type))
        plan = newest
        if reading is not None and now_us - reading.received_us < FORGOTTEN_AFTER_US:
            plan = reading.plan
            self._remember(peer, plan_type, plan, now_us)
        if seq >= len(plan.items):
            return ack(peer, mav.MAV_MISSION_INVALID_SEQUENCE, plan_type)
        is_current = plan is newest and seq == current
        return to(peer, "MISSION_ITEM_INT", *item_fields(peer, seq, plan.items[seq], is_current, plan_type))

    def end(self, peer: Peer, plan_type: int) -> None:
        """Forget what `peer` was reading: it has acknowledged."""
        self._readings.pop((peer, plan_type), None)

    def _remember(self, peer: Peer, plan_type: int, plan: Plan, now_us: int) -> None:
        self._readings.pop((peer, plan_type), None)
        if plan is not NO_PLAN:
            self._readings[peer, plan_type] = _Reading(plan, now_us)
        if len(self._readings) > MAX_READERS:
            del self._readings[next(iter(self._readings))]
