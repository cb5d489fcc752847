"""A MAVLink client without I/O: bytes and the time go in, bytes and events come out.

    for datagram in received:                     the owner's link and clock
        for message in client.receive(datagram, now_us):
            ...                                   telemetry, to be read as it comes
    for datagram in client.poll(now_us):
        link.send(datagram)
    for event in client.take_events():
        ...                                       a vehicle found or lost, a conversation ended

Theory
------
MAVLink is datagrams that may be lost, duplicated and reordered. Some messages are streamed: losing one costs nothing.
The others are requests, https://mavlink.io/en/services/, and each microservice solves the loss in the same way: the
client repeats its request until the vehicle answers, and the vehicle recognises a repetition. So a `Conversation` is a
state machine with two inputs: `poll(now)` returns the current request when it is due, first at once and then after each
silence; `receive(message)` reads an answer, which ends the conversation or moves it to its next request. After too many
requests in vain its result is UNANSWERED. Nothing is sent from `receive`, so however many copies of an answer
arrive, one request follows.

An answer does not name the request that it answers: a COMMAND_ACK holds no more than the number of the command, a
MISSION_ACK the type of the plan. Conversations whose answers could not be told apart share a *lane*, in which they take
turns; conversations in different lanes run side by side. What remains is a copy of an old answer that arrives during
the next conversation of its lane. Where the content shows it (an acknowledgement before the last item was sent, the
value from before the change) it is disregarded; the answer to a repeated command cannot be recognised as old.

Vehicles are found by their HEARTBEAT, and are lost after a silence. A client talks with any number of them. With a key
(`Signing`) it signs what it sends and drops what is not signed; without, it reads over signatures.
"""

from collections import Counter, deque
from collections.abc import Hashable
from typing import NamedTuple, TypeAlias, TypeVar

from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.wire.dialect import (
    AUTOPILOT_COMPONENT,
    AUTOPILOT_INVALID,
    STATE_ACTIVE,
    Codec,
    Message,
    mav,
)
from colibri.mavlink.wire.signing import Signing

HEARTBEAT_EVERY_US = 1_000_000
LOST_AFTER_US = 3_500_000
"""Three heartbeats are missing, and a half: as QGroundControl has it."""
_MAVLINK_VERSION = 3
_EVENTS = 1000

Talk = TypeVar("Talk", bound=Conversation)


class Vehicle(NamedTuple):
    """A vehicle as it identifies itself.

    Attributes:
        system: System id.
        autopilot: MAV_AUTOPILOT.
        kind: MAV_TYPE.
        heartbeat_us: When its last HEARTBEAT arrived.
        lost: Whether it has been silent for too long.
        capabilities: MAV_PROTOCOL_CAPABILITY bits of its AUTOPILOT_VERSION; None before the first.
        uid2: Unique id of its AUTOPILOT_VERSION; empty before the first.
    """

    system: int
    autopilot: int
    kind: int
    heartbeat_us: int
    lost: bool = False
    capabilities: int | None = None
    uid2: bytes = b""

    @property
    def target(self) -> tuple[int, int]:
        """System and component that requests are for."""
        return self.system, AUTOPILOT_COMPONENT


class Found(NamedTuple):
    """A vehicle has sent its first HEARTBEAT, or the first after it was lost."""

    vehicle: Vehicle


class Lost(NamedTuple):
    """A vehicle has been silent for too long."""

    vehicle: Vehicle


class Ended(NamedTuple):
    """A conversation has its result."""

    conversation: Conversation


Event: TypeAlias = Found | Lost | Ended


class Client:
    """One MAVLink component that talks with vehicles.

    Attributes:
        source: Its own system and component id.
        vehicles: All that were found, by system id, in this order.
        dropped: Input that was no message or had no valid signature, counted by reason.
    """

    def __init__(
        self,
        system: int,
        component: int,
        *,
        kind: int = mav.MAV_TYPE_GCS,
        heartbeat_every_us: int | None = HEARTBEAT_EVERY_US,
        only: int = 0,
        all_components: bool = False,
    ) -> None:
        """Speak as a component of MAV_TYPE `kind`.

        Args:
            system: Own system id.
            component: Own component id.
            kind: What its HEARTBEAT says.
            heartbeat_every_us: Interval of its HEARTBEAT; None for none.
            only: System id of the one vehicle to listen to; 0 for all.
            all_components: Whether to return the messages of components that are no autopilots, too.
        """
        self.source = (system, component)
        self.vehicles: dict[int, Vehicle] = {}
        self._codec = Codec(system, component)
        self.dropped: Counter[str] = self._codec.dropped
        self._heartbeat_every_us = heartbeat_every_us
        self._kind, self._only, self._all_components = kind, only, all_components
        self._heartbeat_at_us: int | None = None
        self._signing: Signing | None = None
        self._now_us = 0
        self._lanes: dict[Hashable, list[Conversation]] = {}
        self._events: deque[Event] = deque(maxlen=_EVENTS)

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle that was found first."""
        return next(iter(self.vehicles.values()), None)

    def sign_with(self, signing: Signing | None) -> None:
        """Sign what is sent, and drop what is not signed with the same key; None: neither."""
        self._signing = signing
        self._codec.seal = None if signing is None else lambda frame: signing.sign(frame, 0, self._now_us)

    def begin(self, conversation: Talk) -> Talk:
        """Begin a conversation: its first request is sent at the next poll, or when its lane is free."""
        self._lanes.setdefault((conversation.target, conversation.lane), []).append(conversation)
        return conversation

    def cancel(self, conversation: Conversation) -> None:
        """Abandon a conversation, without an event; one that has ended may be cancelled, too."""
        key = (conversation.target, conversation.lane)
        lane = self._lanes.get(key, [])
        if conversation in lane:
            lane.remove(conversation)
            if not lane:
                del self._lanes[key]

    def encode(self, name: str, *fields: object) -> bytes:
        """Return a message that needs no answer, to be sent now."""
        return self._codec.encode(name, *fields)

    def receive(self, datagram: bytes, now_us: int) -> list[Message]:
        """Read a datagram; return the messages in it that come from vehicles."""
        self._now_us = now_us
        messages = []
        for message in self._codec.decode(datagram):
            system, component = message.source
            is_autopilot = component == AUTOPILOT_COMPONENT
            if not (is_autopilot or self._all_components) or self._only not in (0, system):
                continue
            if self._signing is not None:
                refusal = self._signing.refusal(message.name, message.frame, now_us)
                if refusal is not None:
                    self.dropped[refusal] += 1
                    continue
            if is_autopilot and message.name in ("HEARTBEAT", "AUTOPILOT_VERSION"):
                self._identify(message, now_us)
            if self._lanes:
                self._converse(message, now_us)
            messages.append(message)
        return messages

    def poll(self, now_us: int) -> list[bytes]:
        """Return the datagrams that are due: the own HEARTBEAT, and the requests of conversations."""
        self._now_us = now_us
        datagrams = []
        if self._heartbeat_every_us is not None and now_us >= (self._heartbeat_at_us or now_us):
            self._heartbeat_at_us = now_us + self._heartbeat_every_us
            own = (self._kind, AUTOPILOT_INVALID, 0, 0, STATE_ACTIVE, _MAVLINK_VERSION)
            datagrams.append(self._codec.encode("HEARTBEAT", *own))
        datagrams += self.poll_requests(now_us)
        for system, vehicle in self.vehicles.items():
            if not vehicle.lost and now_us - vehicle.heartbeat_us > LOST_AFTER_US:
                self.vehicles[system] = lost = vehicle._replace(lost=True)
                self._events.append(Lost(lost))
        return datagrams

    def poll_requests(self, now_us: int) -> list[bytes]:
        """Return what conversations have to send, without the HEARTBEAT."""
        if not self._lanes:
            return []
        self._now_us = now_us
        datagrams = []
        for conversation in [lane[0] for lane in self._lanes.values()]:
            datagrams += [self._codec.encode(name, *fields) for name, fields in conversation.poll(now_us)]
            self._retire(conversation)
        return datagrams

    def take_events(self) -> list[Event]:
        """Return the events since the last call; of very many the newest."""
        events = list(self._events)
        self._events.clear()
        return events

    def _identify(self, message: Message, now_us: int) -> None:
        """Note what a vehicle says of itself."""
        fields, system = message.fields, message.source[0]
        known = self.vehicles.get(system)
        if message.name == "AUTOPILOT_VERSION":
            if known is not None:
                uid2 = bytes(fields.uid2)
                self.vehicles[system] = known._replace(capabilities=int(fields.capabilities), uid2=uid2)
        elif fields.autopilot != AUTOPILOT_INVALID:
            met = Vehicle(system, fields.autopilot, fields.type, now_us)
            if known is not None:
                met = met._replace(capabilities=known.capabilities, uid2=known.uid2)
            self.vehicles[system] = met
            if known is None or known.lost:
                self._events.append(Found(met))

    def _converse(self, message: Message, now_us: int) -> None:
        """Hand an answer to the conversations that it may be for: the first of each lane."""
        for conversation in [lane[0] for lane in self._lanes.values()]:
            if (
                message.name in conversation.answers
                and message.source == conversation.target
                and self._is_addressed(message)
            ):
                conversation.receive(message, now_us)
                self._retire(conversation)

    def _is_addressed(self, message: Message) -> bool:
        system, component = self.source
        to_system = getattr(message.fields, "target_system", 0)
        to_component = getattr(message.fields, "target_component", 0)
        return to_system in (0, system) and to_component in (0, component)

    def _retire(self, conversation: Conversation) -> None:
        if conversation.result is not None:
            self.cancel(conversation)
            self._events.append(Ended(conversation))
