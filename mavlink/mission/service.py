"""The mission microservice of mission, geofence and rally points: https://mavlink.io/en/services/mission.html."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite, isnan, nan
from typing import Any, NamedTuple, TypeAlias

from colibri.common.earth.geodesy import MAX_LATITUDE_DEG
from colibri.mavlink.mission.items import (
    ACCEPTED,
    ALL,
    MISSION,
    NO_PLAN,
    PLAN_TYPES,
    MissionItem,
    StoredPlan,
    behind,
    in_old_form,
    item_fields,
    plan_name,
    plan_of,
)
from colibri.mavlink.mission.upload import Rules, Uploads, ack
from colibri.mavlink.node.service import Fields, Peer, Send, to, to_all
from colibri.mavlink.services.command import DEGREES, DENIED, GLOBAL_FRAMES, ReceivedCommand, command_name
from colibri.mavlink.services.statustext import INFO, WARNING, StatusText
from colibri.mavlink.wire.dialect import Message, Refusal, mav
from colibri.mavlink.wire.places import misplaced, misplaced_height

STREAM_EVERY_US = 1_000_000
NO_MISSION_TOTAL = 0xFFFF  # MISSION_CURRENT.total without a mission
GUIDED = 2  # MISSION_ITEM.current of an immediate destination, as DroneKit's simple_goto sends
CHANGE_HEIGHT = 3  # the same of a height, as MAVProxy's changealt sends
FORGOTTEN_AFTER_US = 5_000_000  # silence after which a reader gets the newest plan
MAX_READERS = 32
_OF_A_PLAN = frozenset({"MISSION_COUNT", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST"})


class _Reading(NamedTuple):
    plan: StoredPlan
    received_us: int


class Downloads:
    """Answers readers with the announced plan even if it is replaced meanwhile."""

    def __init__(self) -> None:
        self._readings: dict[tuple[Peer, int], _Reading] = {}

    def begin(self, peer: Peer, plan_type: int, plan: StoredPlan, now_us: int) -> Send:
        self._remember(peer, plan_type, plan, now_us)
        target = (peer.system, peer.component)
        return to(peer, "MISSION_COUNT", *target, len(plan.items), plan_type, plan.id)

    def item(self, peer: Peer, plan_type: int, seq: int, newest: StoredPlan, current: int, now_us: int) -> Send | None:
        """Return an item, if there is one, always as MISSION_ITEM_INT."""
        reading = self._readings.get((peer, plan_type))
        plan = newest
        if reading is not None and now_us - reading.received_us < FORGOTTEN_AFTER_US:
            plan = reading.plan
            self._remember(peer, plan_type, plan, now_us)
        if seq >= len(plan.items):
            return None
        is_current = plan.id == newest.id and seq == current
        return to(peer, "MISSION_ITEM_INT", *item_fields(peer, seq, plan.items[seq], is_current, plan_type))

    def end(self, peer: Peer, plan_type: int) -> None:
        self._readings.pop((peer, plan_type), None)

    def _remember(self, peer: Peer, plan_type: int, plan: StoredPlan, now_us: int) -> None:
        self._readings.pop((peer, plan_type), None)
        if plan is not NO_PLAN:
            self._readings[peer, plan_type] = _Reading(plan, now_us)
        if len(self._readings) > MAX_READERS:
            del self._readings[next(iter(self._readings))]


class MissionProgress(NamedTuple):
    seq: int = 0
    state: int = mav.MISSION_STATE_NO_MISSION  # MISSION_STATE
    mode: int = 2  # 1 in mission mode, otherwise 2


Receiver: TypeAlias = Callable[[Any, Peer, int], Iterable[Send]]


class MissionVehicle(NamedTuple):
    load: Callable[[int, StoredPlan], None]  # (plan type, plan)
    progress: Callable[[], MissionProgress]  # called at every poll
    set_current: Callable[[int, bool], Refusal | None]  # (seq or -1 for the current, reset the counters)
    guided_goto: Callable[[float, float, float, int], Refusal | None]  # (degrees, degrees, m, MAV_FRAME)
    home: Callable[[], MissionItem] | None = None  # of a vehicle whose item 0 is home
    describe: Callable[[int, MissionItem, bool], str] | None = None  # text of an item that begins or is reached


class MissionService:
    """Holds the three plans and serves the mission protocol: one method per message."""

    def __init__(
        self,
        rules: Mapping[int, Rules],
        vehicle: MissionVehicle,
        text: StatusText,
        *,
        streams: bool = True,
        old_form: bool | None = None,
    ) -> None:
        """Serve a vehicle; `streams` sends MISSION_CURRENT unasked, `old_form` uses MISSION_REQUEST, MISSION_ITEM."""
        self.plans: dict[int, StoredPlan] = dict.fromkeys(PLAN_TYPES, NO_PLAN)
        self._vehicle = vehicle
        self._progress = vehicle.progress
        self._text = text
        self._offset, self._streams = int(vehicle.home is not None), streams
        self._uploads = Uploads(rules, self._store, unchecked_first=bool(self._offset), old_form=old_form)
        self._downloads = Downloads()
        self._outbox: list[Send] = []
        self._shown: MissionProgress | None = None
        self._chosen = 0
        self._stream_us = self._due_us = 0
        self._receivers: dict[str, Receiver] = {
            "MISSION_COUNT": self._count,
            "MISSION_REQUEST_LIST": self._request_list,
            "MISSION_REQUEST_INT": self._request,
            "MISSION_REQUEST": self._request_old if old_form else self._request,
            "MISSION_ACK": self._ack,
            "MISSION_CLEAR_ALL": self._clear_all,
            "MISSION_SET_CURRENT": self._set_current,
            "MISSION_WRITE_PARTIAL_LIST": self._write_part,
            "MISSION_REQUEST_PARTIAL_LIST": self._partial,
        }
        self.handles = frozenset((*self._receivers, "MISSION_ITEM_INT", "MISSION_ITEM"))

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        receiver, plan_type = self._receivers.get(message.name), getattr(message.fields, "mission_type", MISSION)
        if plan_type not in PLAN_TYPES and message.name in _OF_A_PLAN:
            return self._refuse(peer, mav.MAV_MISSION_UNSUPPORTED, plan_type)
        sends = self._item(message, peer, now_us) if receiver is None else receiver(message.fields, peer, now_us)
        self._due_us = min(self._stream_us, self._uploads.due_us)
        return sends

    def poll(self, now_us: int) -> Iterable[Send]:
        progress = self._progress()
        if now_us < self._due_us and progress is self._shown and not self._outbox:
            return ()
        sends, self._outbox = self._outbox, []
        sends += self._explained(self._uploads.poll(now_us))
        if progress != self._shown or now_us >= self._stream_us:
            self._stream_us = now_us + STREAM_EVERY_US
            if self._streams:
                sends.append(to_all("MISSION_CURRENT", *self.current()))
            sends += self._described(progress)
        self._shown = progress
        self._due_us = min(self._stream_us, self._uploads.due_us)
        return sends

    def _described(self, progress: MissionProgress) -> list[Send]:
        """Return the text of an item that has begun since the last call."""
        describe, shown, items = self._vehicle.describe, self._shown, self.plans[MISSION].items
        begun = progress.state in (mav.MISSION_STATE_ACTIVE, mav.MISSION_STATE_COMPLETE) and progress.seq < len(items)
        again = shown is not None and (shown.seq == progress.seq and shown.state != mav.MISSION_STATE_NOT_STARTED)
        if describe is None or not begun or again:
            return []
        return self._text.say(INFO, describe(progress.seq + self._offset, items[progress.seq], False))

    def reached(self, seq: int) -> None:
        self._outbox.append(to_all("MISSION_ITEM_REACHED", seq + self._offset))
        items, describe = self.plans[MISSION].items, self._vehicle.describe
        text = describe(seq + self._offset, items[seq], True) if describe and seq < len(items) else ""
        self._outbox += self._text.say(INFO, text) if text else ()

    def _seq(self) -> int:
        """Return the current item as clients count; 0 until a mission with home has begun, or its first was chosen."""
        progress = self._progress()
        begun = progress.state not in (mav.MISSION_STATE_NO_MISSION, mav.MISSION_STATE_NOT_STARTED)
        return progress.seq + self._offset if begun or progress.seq else self._chosen

    def current(self) -> Fields:
        progress = self._progress()
        total = len(self.plans[MISSION].items) or (0 if self._offset else NO_MISSION_TOTAL)
        return (self._seq(), total, progress.state, progress.mode, *self.ids)

    @property
    def ids(self) -> tuple[int, ...]:
        return tuple(self.plans[plan_type].id for plan_type in PLAN_TYPES)

    def restore(self, plans: Mapping[int, Sequence[MissionItem]]) -> None:
        """Hold plans kept over a restart, without loading them."""
        self.plans.update({plan_type: plan_of(plans.get(plan_type, ())) for plan_type in PLAN_TYPES})

    def load(self, plan_type: int, items: Sequence[MissionItem]) -> StoredPlan:
        self.plans[plan_type] = plan = plan_of(items)
        self._chosen = self._chosen if plan_type != MISSION else 0
        self._vehicle.load(plan_type, plan)
        self._announce()
        return plan

    def _store(self, plan_type: int, items: Sequence[MissionItem]) -> StoredPlan:
        """Load an uploaded plan as the vehicle counts: without home."""
        if plan_type == MISSION and self._offset:
            items = [behind(item, -self._offset) for item in items[self._offset :]]
        return self.load(plan_type, items)

    def do_set_mission_current(self, command: ReceivedCommand) -> Refusal | None:
        seq, reset = command.p1, 0.0 if isnan(command.p2) else command.p2
        if not isfinite(seq) or seq != int(seq):
            return Refusal(f"mission: item {seq:g} is not a whole number")
        if reset not in (0.0, 1.0):
            return Refusal(f"mission: reset {reset:g} is not 0 or 1")
        if self._offset and seq < 0.0:
            return Refusal(f"mission: item {seq:g} is not 0 or more")
        refusal = self.choose(int(seq), reset == 1.0)
        if refusal is not None and self._offset:
            return refusal._replace(result=DENIED)
        if refusal is None:
            self._announce()
        return refusal

    def choose(self, seq: int, reset: bool = False) -> Refusal | None:
        """Go to an item, as clients count."""
        refusal = self._vehicle.set_current(max(seq - self._offset, 0) if self._offset else seq, reset)
        if refusal is not None and self._offset:
            return refusal._replace(reason=f"mission: item {seq} is not within 0 to {len(self.plans[MISSION].items)}")
        if self._offset:
            self._chosen = min(seq, self._offset)
        return refusal

    def _announce(self) -> None:
        self._stream_us = self._due_us = 0

    def _count(self, fields: Any, peer: Peer, now_us: int) -> Iterable[Send]:
        self._downloads.end(peer, fields.mission_type)
        return self._explained([self._uploads.begin(peer, fields.mission_type, fields.count, now_us)])

    def _item(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        fields = message.fields
        if fields.current >= GUIDED and not self._uploads.expects(peer, fields.mission_type):
            result, reason = self._fly_to(message)
            return [ack(peer, result, fields.mission_type), *(self._text.say(WARNING, reason) if reason else ())]
        return self._explained([self._uploads.item(message, peer, now_us)])

    def _fly_to(self, message: Message) -> tuple[int, str]:
        fields = message.fields
        scale = DEGREES if message.name == "MISSION_ITEM_INT" else 1.0
        latitude, longitude = fields.x * scale, fields.y * scale
        climbs = fields.current == CHANGE_HEIGHT and self._vehicle.home is not None
        known = (fields.command, fields.mission_type) == (mav.MAV_CMD_NAV_WAYPOINT, MISSION)
        known &= climbs or fields.current == GUIDED
        what = f"item to fly to now (current {fields.current}): {command_name(fields.command)}"
        if not known:
            return mav.MAV_MISSION_UNSUPPORTED, f"{what} is not supported"
        if fields.frame not in GLOBAL_FRAMES:
            return mav.MAV_MISSION_UNSUPPORTED_FRAME, f"{what} in frame {fields.frame}"
        if climbs:
            latitude = longitude = nan
        place = "" if climbs else misplaced(latitude, longitude)
        if place:
            at_x = not abs(latitude) <= MAX_LATITUDE_DEG
            return mav.MAV_MISSION_INVALID_PARAM5_X if at_x else mav.MAV_MISSION_INVALID_PARAM6_Y, f"{what}: {place}"
        if misplaced_height(fields.z):
            return mav.MAV_MISSION_INVALID_PARAM7, f"{what}: {misplaced_height(fields.z)}"
        refusal = self._vehicle.guided_goto(latitude, longitude, fields.z, fields.frame)
        return (ACCEPTED, "") if refusal is None else (mav.MAV_MISSION_DENIED, refusal.reason)

    def _request_list(self, fields: Any, peer: Peer, now_us: int) -> Iterable[Send]:
        self._uploads.hush(peer)
        plan_type = fields.mission_type
        return [self._downloads.begin(peer, plan_type, self._as_sent(plan_type), now_us)]

    def _as_sent(self, plan_type: int) -> StoredPlan:
        """Return a plan as clients see it: a mission with home as its first item."""
        plan, home = self.plans[plan_type], self._vehicle.home
        if plan_type != MISSION or home is None or not plan.items:
            return plan
        return StoredPlan((home(), *(behind(item, self._offset) for item in plan.items)), plan.id)

    def _request(self, fields: Any, peer: Peer, now_us: int) -> Iterable[Send]:
        plan_type, home = fields.mission_type, self._vehicle.home
        current = self._seq() if plan_type == MISSION else -1
        if home is not None and plan_type == MISSION and fields.seq == 0:
            return [to(peer, "MISSION_ITEM_INT", *item_fields(peer, 0, home(), current == 0, plan_type))]
        plan = self._as_sent(plan_type)
        found = self._downloads.item(peer, plan_type, fields.seq, plan, current, now_us)
        if found is None:
            why = f"there is no item {fields.seq}"
            return self._refuse(peer, mav.MAV_MISSION_INVALID_SEQUENCE, plan_type, why)
        return [found]

    def _request_old(self, fields: Any, peer: Peer, now_us: int) -> Iterable[Send]:
        sends = self._request(fields, peer, now_us)
        return [in_old_form(send) if send.name == "MISSION_ITEM_INT" else send for send in sends]

    def _ack(self, fields: Any, peer: Peer, now_us: int) -> Iterable[Send]:
        self._downloads.end(peer, fields.mission_type)
        return self._explained([self._uploads.acknowledged(peer, fields.mission_type, fields.type, now_us)])

    def _clear_all(self, fields: Any, peer: Peer, _now_us: int) -> Iterable[Send]:
        plan_type = fields.mission_type
        if plan_type not in (*PLAN_TYPES, ALL):
            return self._refuse(peer, mav.MAV_MISSION_UNSUPPORTED, plan_type)
        cleared = PLAN_TYPES if plan_type == ALL else (plan_type,)
        self._uploads.drop(peer, cleared)
        for each in cleared:
            self.load(each, ())
        return [ack(peer, ACCEPTED, plan_type)]

    def _set_current(self, fields: Any, _peer: Peer, _now_us: int) -> Iterable[Send]:
        refusal = self.choose(fields.seq)
        if refusal is not None:
            return self._text.say(WARNING, refusal.reason)
        self._announce()
        return ()

    def _write_part(self, fields: Any, peer: Peer, now_us: int) -> Iterable[Send]:
        """Begin to replace some items, of a vehicle whose item 0 is home."""
        if self._vehicle.home is None or fields.mission_type != MISSION:
            return self._partial(fields, peer, now_us)
        plan, first, last = self._as_sent(MISSION), fields.start_index, fields.end_index
        if not 0 <= first <= last < len(plan.items):
            why = f"items {first} to {last} are not within 0 to {len(plan.items) - 1}"
            return self._refuse(peer, mav.MAV_MISSION_INVALID_SEQUENCE, MISSION, why)
        self._downloads.end(peer, MISSION)
        count = last - first + 1
        return self._explained([self._uploads.begin(peer, MISSION, count, now_us, first=first, replaces=plan.items)])

    def _partial(self, fields: Any, peer: Peer, _now_us: int) -> Iterable[Send]:
        return self._refuse(peer, mav.MAV_MISSION_UNSUPPORTED, fields.mission_type, "partial lists are not supported")

    def _refuse(self, peer: Peer, result: int, plan_type: int, why: str = "not known") -> list[Send]:
        text = self._text.say(WARNING, f"{plan_name(plan_type)} refused: {why}")
        return [ack(peer, result, plan_type), *text]

    def _explained(self, sends: Iterable[Send | None]) -> list[Send]:
        reason = self._uploads.take_reason()
        text = self._text.say(WARNING, reason) if reason else ()
        return [*filter(None, sends), *text]
