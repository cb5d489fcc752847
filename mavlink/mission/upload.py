"""Uploads of plans: the vehicle requests each item and replaces the old plan by a complete, valid one.

Specification: https://mavlink.io/en/services/mission.html. Two choices follow PX4, because clients rely on them:

- Requests are repeated every 250 ms for five seconds. Five retries would let two of three uploads of 500 items fail
  over a link that loses a fifth of the datagrams each way.
- Any MISSION_ACK ends MAVSDK's current transfer. So an unexpected one is never sent.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from colibri.mavlink.mission.items import ACCEPTED, MISSION, MissionItem, StoredPlan, fault_of, item_of, plan_name
from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.services.command import command_name
from colibri.mavlink.wire.dialect import Message, mav

ASK_EVERY_US = 250_000
PATIENCE_US = 5_000_000
GIVES_WAY_AFTER_US = 20_000_000  # then another station may upload: one that repeats itself must not keep others out
OLD_FORM_AFTER = 2  # unanswered requests before every other one is the old MISSION_REQUEST
ANSWER_AGAIN_AFTER_US = 200_000  # an earlier copy of the last item is a link's duplicate, a later one was sent again
NEVER_US = 2**63


class Rules(NamedTuple):
    """Limits of a plan of one type, by MAV_MISSION_RESULT."""

    check_item: Callable[[MissionItem], int]
    check_plan: Callable[[Sequence[MissionItem]], tuple[int, int]]  # with the number of the item that is refused
    maximum: int = 1000


class _Answer(NamedTuple):
    peer: Peer
    seq: int
    send: Send
    at_us: int


@dataclass
class _Upload:
    peer: Peer
    plan_type: int
    count: int
    received_us: int  # of the last item
    began_us: int  # also of those that the channel began and replaced
    old_form: bool | None  # whether items are requested by MISSION_REQUEST, if that is settled
    first: int = 0
    replaces: Sequence[MissionItem] = ()  # the whole plan, if items from `first` on replace a part
    items: list[MissionItem] = field(default_factory=list)
    due_us: int = 0
    quiet: bool = False
    asked_in_old_form: bool = False
    _asked: int = 0
    _last_form: bool = False

    def ask(self, now_us: int) -> Send:
        """Request the next item, first in the new form: some nack MISSION_REQUEST (MAVSDK), some require it."""
        old = bool(self.old_form)
        if self.old_form is None and self._asked >= OLD_FORM_AFTER:
            old = self._asked % 2 == 0
        self._asked += 1
        self._last_form = old
        self.asked_in_old_form |= old
        self.due_us = now_us + ASK_EVERY_US
        name = "MISSION_REQUEST" if old else "MISSION_REQUEST_INT"
        return to(self.peer, name, self.peer.system, self.peer.component, self.next, self.plan_type)

    @property
    def next(self) -> int:
        """Number of the item that is requested."""
        return self.first + len(self.items)

    @property
    def whole(self) -> list[MissionItem]:
        """The plan with the uploaded items in place."""
        return [*self.replaces[: self.first], *self.items, *self.replaces[self.next :]]

    def take(self, item: MissionItem, now_us: int) -> None:
        self.items.append(item)
        self.received_us = now_us
        self.quiet = False
        self._asked = 0
        if not self.asked_in_old_form:
            self.old_form = False
        elif self.old_form is None and self._last_form:
            self.old_form = True


class Uploads:
    """The uploads in progress, one per type and ground station."""

    def __init__(
        self,
        rules: Mapping[int, Rules],
        store: Callable[[int, Sequence[MissionItem]], StoredPlan],
        *,
        unchecked_first: bool = False,
        old_form: bool | None = None,
    ) -> None:
        """Store plans by `store`; `unchecked_first` accepts any item 0 of a mission."""
        self._rules, self._unchecked_first, self._first_form = rules, unchecked_first, old_form
        self._store = store
        self._under_way: dict[int, _Upload] = {}
        self._reason = ""
        self._answers: dict[int, _Answer] = {}

    def begin(
        self,
        peer: Peer,
        plan_type: int,
        count: int,
        now_us: int,
        *,
        first: int = 0,
        replaces: Sequence[MissionItem] = (),
    ) -> Send:
        """Handle a MISSION_COUNT: a repeated one restarts; another station's upload is finished first."""
        other = self._under_way.get(plan_type)
        began_us = other.began_us if other is not None and other.peer.channel == peer.channel else now_us
        if other is not None and other.peer != peer:
            if now_us - other.began_us < GIVES_WAY_AFTER_US:
                return self._refuse(peer, mav.MAV_MISSION_DENIED, plan_type, "another station is uploading")
            self.drop(other.peer, (plan_type,))
        self.drop(peer, tuple(self._under_way))
        self._answers.pop(plan_type, None)
        maximum = self._rules[plan_type].maximum
        if count > maximum:
            return self._refuse(peer, mav.MAV_MISSION_NO_SPACE, plan_type, f"{count} items, more than {maximum}")
        if count == 0:  # "has the same effect as clearing the mission"
            return ack(peer, ACCEPTED, plan_type, self._store(plan_type, ()).id)
        upload = self._under_way[plan_type] = _Upload(
            peer, plan_type, count, now_us, began_us, self._first_form, first, replaces
        )
        return upload.ask(now_us)

    @property
    def due_us(self) -> int:
        return min((upload.due_us for upload in self._under_way.values()), default=NEVER_US)

    def expects(self, peer: Peer, plan_type: int) -> bool:
        upload = self._under_way.get(plan_type)
        return upload is not None and upload.peer == peer

    def item(self, message: Message, peer: Peer, now_us: int) -> Send | None:
        fields = message.fields
        upload = self._under_way.get(fields.mission_type)
        if upload is None or upload.peer != peer:
            return self._answer_again(fields, peer, now_us)
        expected = upload.next
        if fields.seq < expected:  # a copy: to ask again would have every later item sent twice
            return None
        if fields.seq > expected:  # "the expected item should be re-requested"
            return upload.ask(now_us)
        item = item_of(message.name, fields)
        if isinstance(item, int):
            self._blame(upload, expected, f"{command_name(fields.command)} at {fields.x:g}, {fields.y:g}")
            return self._end(upload, item, 0, now_us)
        unchecked = self._unchecked_first and not expected and upload.plan_type == MISSION
        result = ACCEPTED if unchecked else self._rules[upload.plan_type].check_item(item)
        if result != ACCEPTED:
            self._blame(upload, expected, fault_of(item, result))
            return self._end(upload, result, 0, now_us)
        upload.take(item, now_us)
        if len(upload.items) < upload.count:
            return upload.ask(now_us)
        return self._complete(upload, now_us)

    def acknowledged(self, peer: Peer, plan_type: int, result: int, now_us: int) -> Send | None:
        upload = self._under_way.get(plan_type)
        if upload is None or upload.peer != peer or result == ACCEPTED:  # a late one of a download accepts
            return None
        if result == mav.MAV_MISSION_UNSUPPORTED and upload.asked_in_old_form:
            upload.old_form = False
            return upload.ask(now_us)
        self.drop(peer, (plan_type,))
        return None

    def drop(self, peer: Peer, plan_types: Sequence[int]) -> None:
        for plan_type in plan_types:
            if self.expects(peer, plan_type):
                del self._under_way[plan_type]

    def hush(self, peer: Peer) -> None:
        """End the peer's uploads silently if they time out."""
        for upload in self._under_way.values():
            upload.quiet |= upload.peer == peer

    def poll(self, now_us: int) -> list[Send]:
        sends = []
        for upload in list(self._under_way.values()):
            if now_us < upload.due_us:
                continue
            if now_us - upload.received_us < PATIENCE_US:
                sends.append(upload.ask(now_us))
                continue
            del self._under_way[upload.plan_type]
            if not upload.quiet:
                why = f"item {upload.next} of {upload.first + upload.count} did not arrive"
                sends.append(self._refuse(upload.peer, mav.MAV_MISSION_OPERATION_CANCELLED, upload.plan_type, why))
        return sends

    def _complete(self, upload: _Upload, now_us: int) -> Send:
        items = upload.whole
        result, seq = self._rules[upload.plan_type].check_plan(items)
        if result != ACCEPTED:
            self._blame(upload, seq, fault_of(items[seq], result))
        plan_id = self._store(upload.plan_type, items).id if result == ACCEPTED else 0
        return self._end(upload, result, plan_id, now_us)

    def take_reason(self) -> str:
        """Return why something was refused since the last call, or ""."""
        reason, self._reason = self._reason, ""
        return reason

    def _blame(self, upload: _Upload, seq: int, fault: str) -> None:
        self._reason = f"{plan_name(upload.plan_type)} item {seq}: {fault}"

    def _refuse(self, peer: Peer, result: int, plan_type: int, why: str) -> Send:
        self._reason = f"{plan_name(plan_type)} refused: {why}"
        return ack(peer, result, plan_type)

    def _end(self, upload: _Upload, result: int, plan_id: int, now_us: int) -> Send:
        self.drop(upload.peer, (upload.plan_type,))
        send = ack(upload.peer, result, upload.plan_type, plan_id)
        last = max(0, upload.next - 1) if result == ACCEPTED else upload.next
        self._answers[upload.plan_type] = _Answer(upload.peer, last, send, now_us)
        return send

    def _answer_again(self, fields: Any, peer: Peer, now_us: int) -> Send | None:
        answer = self._answers.get(fields.mission_type)
        if answer is None or answer.peer != peer or answer.seq != fields.seq:
            return None
        return answer.send if ANSWER_AGAIN_AFTER_US <= now_us - answer.at_us < PATIENCE_US else None


def ack(peer: Peer, result: int, plan_type: int, plan_id: int = 0) -> Send:
    return to(peer, "MISSION_ACK", peer.system, peer.component, result, plan_type, plan_id)
