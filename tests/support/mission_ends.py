"""A ground station's end of the mission protocol, and a link that loses, copies and reorders, for tests."""

import random
from collections.abc import Callable, Iterable, Sequence
from struct import pack
from typing import Any

from colibri.mavlink.mission.items import (
    ACCEPTED,
    MISSION,
    PLAN_TYPES,
    MissionItem,
    Plan,
)
from colibri.mavlink.mission.service import MissionService, Progress, Vehicle
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.wire.dialect import Codec, Message, mav
from colibri.mavlink.wire.refusal import Refusal

STEP_US = 4_000
VEHICLE = (1, 1)
FIRST = Peer(0, 255, 190)
SECOND = Peer(1, 255, 190)
VALID = Rules(lambda _: ACCEPTED, lambda _: ACCEPTED)


def some_item(number: int = 0, **changes: Any) -> MissionItem:
    """Return an item that differs from those of other numbers."""
    values = (3, 16, 1, 0.5 * number, 1.0, float("nan"), -0.25, 473977420 + number, 85455940 - number, 2.5 + number)
    return MissionItem(*values)._replace(**changes)


ITEMS = [some_item(number) for number in range(3)]


class Ground:
    """The vehicle behind a service, as far as missions go."""

    def __init__(self, rules: Rules = VALID) -> None:
        self.loaded: list[tuple[int, Plan]] = []
        self.progress = Progress()
        self.set: list[tuple[int, bool]] = []
        self.refuses: Refusal | None = None
        self.flown_to: list[tuple[float, float, float, int]] = []
        self.guided: Refusal | None = None
        vehicle = Vehicle(
            lambda plan_type, plan: self.loaded.append((plan_type, plan)),
            lambda: self.progress,
            self._set_current,
            self._guided_goto,
        )
        self.service = MissionService(dict.fromkeys(PLAN_TYPES, rules), vehicle, StatusText())
        self.codec = Codec(*VEHICLE)
        self.now_us = 0

    def _set_current(self, seq: int, reset: bool) -> Refusal | None:
        if self.refuses is None:
            self.set.append((seq, reset))
        return self.refuses

    def _guided_goto(self, latitude: float, longitude: float, altitude: float, frame: int) -> Refusal | None:
        self.flown_to.append((latitude, longitude, altitude, frame))
        return self.guided

    def hear(self, peer: Peer, name: str, *fields: Any) -> list[Message]:
        """Let the service hear a message; return its answers as a ground station decodes them."""
        (message,) = Codec(peer.system, peer.component).decode(Codec(*peer[1:]).encode(name, *fields))
        return self.decoded(self.service.receive(message, peer, self.now_us))

    def poll(self, after_us: int = 0) -> list[Message]:
        """Let time pass; return what the service says then."""
        self.now_us += after_us
        return self.decoded(self.service.poll(self.now_us))

    def decoded(self, sends: Iterable[Send]) -> list[Message]:
        """Return messages as they come off the wire."""
        return [message for send in sends for message in self.codec.decode(self.codec.encode(send.name, *send.fields))]


class Station:
    """A ground station that uploads or downloads one plan, and tries again as real ones do."""

    def __init__(self, peer: Peer, *, asks_for: str = "MISSION_REQUEST_INT") -> None:
        self.peer = peer
        self.outbox: list[tuple[str, tuple[Any, ...]]] = []
        self.items: Sequence[MissionItem] = ()
        self.result: int | None = None
        self.opaque_id: int | None = None
        self.received: list[MissionItem] = []
        self._asks_for = asks_for
        self._plan_type = 0
        self._repeat: Callable[[], None] = lambda: None
        self._due_us = 2**62
        self._count: int | None = None

    def upload(self, plan_type: int, items: Sequence[MissionItem], now_us: int) -> None:
        """Begin an upload."""
        self.items, self.result, self._plan_type = items, None, plan_type
        self._say(now_us, 500_000, "MISSION_COUNT", *VEHICLE, len(items), plan_type)

    def download(self, plan_type: int, now_us: int) -> None:
        """Begin a download."""
        self.received, self.result, self._plan_type, self._count = [], None, plan_type, None
        self._say(now_us, 500_000, "MISSION_REQUEST_LIST", *VEHICLE, plan_type)

    def hear(self, message: Message, now_us: int) -> None:
        """Take a message of the vehicle in."""
        fields = message.fields
        if self.result is not None:
            return
        if message.name in ("MISSION_REQUEST_INT", "MISSION_REQUEST") and fields.seq < len(self.items):
            item = self.items[fields.seq]
            self._say(now_us, 1_500_000, "MISSION_ITEM_INT", *VEHICLE, fields.seq, *fielded(item, self._plan_type))
        elif message.name == "MISSION_ACK":
            self.result, self.opaque_id, self._due_us = fields.type, fields.opaque_id, 2**62
        elif message.name == "MISSION_COUNT" and self._count is None:
            self._count, self.opaque_id = fields.count, fields.opaque_id
            self._ask(now_us)
        elif message.name == "MISSION_ITEM_INT" and fields.seq == len(self.received) and self._count is not None:
            self.received.append(
                MissionItem(
                    fields.frame, fields.command, fields.autocontinue, *list(fields)[7:11], *list(fields)[11:14]
                )
            )
            self._ask(now_us)

    def poll(self, now_us: int) -> None:
        """Say the last thing again if it stays unanswered."""
        if now_us >= self._due_us:
            self._repeat()

    def _ask(self, now_us: int) -> None:
        if len(self.received) == self._count:
            self._say(now_us, 2**61, "MISSION_ACK", *VEHICLE, ACCEPTED, self._plan_type)
            self.result = ACCEPTED
        else:
            self._say(now_us, 250_000, self._asks_for, *VEHICLE, len(self.received), self._plan_type)

    def _say(self, now_us: int, again_after_us: int, name: str, *fields: Any) -> None:
        self.outbox.append((name, fields))
        self._due_us = now_us + again_after_us
        self._repeat = lambda: self._say(self._due_us, again_after_us, name, *fields)


def fielded(item: MissionItem, plan_type: int = 0, current: int = 0) -> tuple[Any, ...]:
    """Return the fields of a MISSION_ITEM_INT after its sequence number."""
    return (item.frame, item.command, current, *item[2:], plan_type)


class Link:
    """Datagrams between stations and a service, some of which do not arrive, or twice, or late."""

    def __init__(self, ground: Ground, stations: Sequence[Station], seed: int, *, loss: float, unruly: float) -> None:
        self._ground, self._stations = ground, stations
        self._chance = random.Random(seed)
        self._loss, self._unruly = loss, unruly
        self._codecs = [Codec(*station.peer[1:]) for station in stations]
        self._up: list[tuple[int, Peer, bytes]] = []
        self._down: list[tuple[int, int, bytes]] = []
        self.datagrams = 0

    def run(self, max_us: int, until: Callable[[], bool]) -> bool:
        """Let time pass until something is so; return whether it came to be."""
        end_us = self._ground.now_us + max_us
        while self._ground.now_us < end_us and not until():
            self._step()
        return until()

    def _step(self) -> None:
        ground = self._ground
        ground.now_us += STEP_US
        self._send_down(ground.service.poll(ground.now_us))
        due, self._up = _due(self._up, ground.now_us)
        for _, peer, frame in due:
            for message in ground.codec.decode(frame):
                self._send_down(ground.service.receive(message, peer, ground.now_us))
        arrived, self._down = _due(self._down, ground.now_us)
        for _, index, frame in arrived:
            for message in self._codecs[index].decode(frame):
                self._stations[index].hear(message, ground.now_us)
        for station, codec in zip(self._stations, self._codecs, strict=True):
            station.poll(ground.now_us)
            for name, fields in station.outbox:
                self._up += [(at, station.peer, codec.encode(name, *fields)) for at in self._arrivals()]
            station.outbox.clear()

    def _send_down(self, sends: Iterable[Send]) -> None:
        for send in sends:
            frame = self._ground.codec.encode(send.name, *send.fields)
            for index, station in enumerate(self._stations):
                if send.channel in (None, station.peer.channel):
                    self._down += [(at, index, frame) for at in self._arrivals()]

    def _arrivals(self) -> list[int]:
        """When a datagram arrives: never, once or twice."""
        self.datagrams += 1
        times = [] if self._chance.random() < self._loss else [STEP_US]
        if times and self._chance.random() < self._unruly:
            times = [self._chance.randrange(1, 20) * STEP_US for _ in range(self._chance.choice((1, 2)))]
        return [self._ground.now_us + time for time in times]


def _due(waiting: list[Any], now_us: int) -> tuple[list[Any], list[Any]]:
    due = sorted((entry for entry in waiting if entry[0] <= now_us), key=lambda entry: entry[0])
    return due, [entry for entry in waiting if entry[0] > now_us]


def results(messages: Iterable[Message]) -> list[int]:
    """Return the results of the MISSION_ACKs among messages."""
    return [message.fields.type for message in messages if message.name == "MISSION_ACK"]


def asked(messages: Iterable[Message]) -> list[tuple[str, int]]:
    """Return what items are asked for."""
    names = ("MISSION_REQUEST_INT", "MISSION_REQUEST")
    return [(message.name, message.fields.seq) for message in messages if message.name in names]


CANCELLED: int = mav.MAV_MISSION_OPERATION_CANCELLED


def count(ground: Ground, number: int, peer: Any = FIRST, plan_type: int = MISSION) -> list[Any]:
    """Begin an upload of so many items; return the answers."""
    return ground.hear(peer, "MISSION_COUNT", *VEHICLE, number, plan_type)


def give(ground: Ground, seq: int, item: MissionItem, peer: Any = FIRST, plan_type: int = MISSION) -> list[Any]:
    """Give an item of an upload; return the answers."""
    return ground.hear(peer, "MISSION_ITEM_INT", *VEHICLE, seq, *fielded(item, plan_type))


def upload(ground: Ground, items: Any = ITEMS, plan_type: int = MISSION) -> list[Any]:
    """Give every item as it is asked for; return the last answers."""
    answers = count(ground, len(items), plan_type=plan_type)
    for seq, item in enumerate(items):
        assert asked(answers) == [("MISSION_REQUEST_INT", seq)]
        answers = give(ground, seq, item, plan_type=plan_type)
    return answers


def bits(items: Any) -> list[bytes]:
    return [pack("<BHBffffiif", *item) for item in items]
