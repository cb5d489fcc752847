"""Missions, fences and rally points, uploaded and downloaded: https://mavlink.io/en/services/mission.html."""

from collections.abc import Sequence

from colibri.mavlink.client.conversation import OK, USUALLY, Conversation, Encoded, Repeat, Target
from colibri.mavlink.mission.items import MISSION, MissionItem, item_of
from colibri.mavlink.wire.dialect import Message


class _PlanConversation(Conversation):
    """A conversation about one plan; `result` is a MAV_MISSION_RESULT."""

    def __init__(self, target: Target, plan: int, repeat: Repeat) -> None:
        super().__init__(target, ("plan", plan), repeat)
        self.plan = plan
        self.opaque_id = 0  # the vehicle's id of the plan

    def _read(self, message: Message) -> None:
        if message.fields.mission_type != self.plan:
            return
        if message.name == "MISSION_ACK":
            self._acknowledge(message.fields.type)
            self.opaque_id = message.fields.opaque_id
        else:
            self._take(message)

    def _acknowledge(self, result: int) -> None:
        self.result = result

    def _take(self, message: Message) -> None:
        raise NotImplementedError


class Upload(_PlanConversation):
    """An upload: the vehicle requests each item."""

    answers = frozenset({"MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"})

    def __init__(
        self, target: Target, items: Sequence[MissionItem], plan: int = MISSION, *, repeat: Repeat = USUALLY
    ) -> None:
        super().__init__(target, plan, repeat)
        self.items = tuple(items)
        self.seq: int | None = None  # the last item sent, the subject of a refusal
        self._highest = -1

    def _acknowledge(self, result: int) -> None:
        if result != OK or self._highest == len(self.items) - 1:  # else it belongs to an upload before
            self.result = result

    def _take(self, message: Message) -> None:
        seq = message.fields.seq
        if seq < len(self.items):
            self.seq = seq
            self._highest = max(self._highest, seq)
            self._go_on()

    def _request(self) -> Sequence[Encoded]:
        if self.seq is None:
            return (("MISSION_COUNT", (*self.target, len(self.items), self.plan)),)
        item = self.items[self.seq]
        fields = (*self.target, self.seq, item.frame, item.command, 0, *item[2:], self.plan)
        return (("MISSION_ITEM_INT", fields),)


class Download(_PlanConversation):
    """A download, item by item, acknowledged by the client."""

    answers = frozenset({"MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"})

    def __init__(self, target: Target, plan: int = MISSION, *, repeat: Repeat = USUALLY) -> None:
        super().__init__(target, plan, repeat)
        self.count: int | None = None
        self._items: dict[int, MissionItem] = {}

    @property
    def items(self) -> tuple[MissionItem, ...]:
        return tuple(item for _, item in sorted(self._items.items()))

    def _take(self, message: Message) -> None:
        fields = message.fields
        if message.name == "MISSION_COUNT":
            if self.count is None:
                self.count, self.opaque_id = fields.count, fields.opaque_id
                self._go_on()
        elif self.count is not None and fields.seq < self.count and fields.seq not in self._items:
            item = item_of(message.name, fields)
            assert isinstance(item, MissionItem), "its place is of integers"
            self._items[fields.seq] = item
            self._go_on()

    def _request(self) -> Sequence[Encoded]:
        if self.count is None:
            return (("MISSION_REQUEST_LIST", (*self.target, self.plan)),)
        missing = next((seq for seq in range(self.count) if seq not in self._items), None)
        if missing is not None:
            return (("MISSION_REQUEST_INT", (*self.target, missing, self.plan)),)
        self.result = OK
        return (("MISSION_ACK", (*self.target, OK, self.plan)),)
