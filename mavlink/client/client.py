"""A MAVLink client without I/O: bytes and the time go in, bytes and events come out.

    for datagram in received:                     the owner's link and clock
        for message in client.receive(datagram, now_us):
            ...                                   telemetry
    for datagram in client.poll(now_us):
        link.send(datagram)
    for event in client.take_events():
        ...                                       a vehicle found or lost, a conversation ended

Theory
------
MAVLink datagrams may be lost, duplicated and reordered. Requests (https://mavlink.io/en/services/) are repeated until
the vehicle answers. So a `Conversation` has two inputs: `poll(now)` returns the current request when it is due, first
at once and then after each silence; `receive(message)` reads an answer, which ends the conversation or moves it to its
next request. `receive` never sends, so duplicate answers cause one request only.

An answer does not identify its request: a COMMAND_ACK has only the number of the command. Conversations with
indistinguishable answers share a *lane* and take turns. An old answer during the next conversation of its lane is
ignored if its content shows its age (an acknowledgement before the last item was sent, the value from before the
change); for a repeated command this is impossible.
"""

from collections import Counter, deque
from collections.abc import Hashable
from typing import NamedTuple, TypeAlias, TypeVar

from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.node.router import concerns, target_of
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, AUTOPILOT_INVALID, STATE_ACTIVE, Codec, Message, mav
from colibri.mavlink.wire.signing import Signing

HEARTBEAT_EVERY_US = 1_000_000
LOST_AFTER_US = 3_500_000  # three and a half heartbeats, as in QGroundControl
_MAVLINK_VERSION = 3
_EVENTS = 1000

Talk = TypeVar("Talk", bound=Conversation)


class RemoteVehicle(NamedTuple):
    system: int
    autopilot: int  # MAV_AUTOPILOT
    kind: int  # MAV_TYPE
    heartbeat_us: int  # of the last HEARTBEAT
    lost: bool = False
    capabilities: int | None = None  # MAV_PROTOCOL_CAPABILITY bits
    uid2: bytes = b""

    @property
    def target(self) -> tuple[int, int]:
        return self.system, AUTOPILOT_COMPONENT


class VehicleFound(NamedTuple):
    """A vehicle's first HEARTBEAT, or the first after it was lost."""

    vehicle: RemoteVehicle


class VehicleLost(NamedTuple):
    """A vehicle has been silent for `LOST_AFTER_US`."""

    vehicle: RemoteVehicle


class ConversationEnded(NamedTuple):
    conversation: Conversation


Event: TypeAlias = VehicleFound | VehicleLost | ConversationEnded


class Client:
    """A MAVLink component in conversation with any number of vehicles."""

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
        """Create a component of MAV_TYPE `kind`; by default it receives only autopilots, of all systems."""
        self.source = (system, component)  # own system and component id
        self.vehicles: dict[int, RemoteVehicle] = {}  # by system id
        self._codec = Codec(system, component)
        self.dropped: Counter[str] = self._codec.dropped  # invalid input, by reason
        self._heartbeat_every_us = heartbeat_every_us
        self._kind, self._only, self._all_components = kind, only, all_components
        self._heartbeat_at_us: int | None = None
        self._signing: Signing | None = None
        self._lanes: dict[Hashable, list[Conversation]] = {}
        self._events: deque[Event] = deque(maxlen=_EVENTS)

    @property
    def vehicle(self) -> RemoteVehicle | None:
        return next(iter(self.vehicles.values()), None)

    def sign_with(self, signing: Signing | None) -> None:
        self._signing = signing
        self._codec.seal = None if signing is None else lambda frame: signing.sign(frame, 0)

    def begin(self, conversation: Talk) -> Talk:
        """Queue a conversation: its first request is sent when its lane is free."""
        self._lanes.setdefault((conversation.target, conversation.lane), []).append(conversation)
        return conversation

    def cancel(self, conversation: Conversation) -> None:
        key = (conversation.target, conversation.lane)
        lane = self._lanes.get(key, [])
        if conversation in lane:
            lane.remove(conversation)
            if not lane:
                del self._lanes[key]

    def encode(self, name: str, *fields: object) -> bytes:
        return self._codec.encode(name, *fields)

    def receive(self, datagram: bytes, now_us: int) -> list[Message]:
        messages = []
        for message in self._codec.decode(datagram):
            system, component = message.source
            is_autopilot = component == AUTOPILOT_COMPONENT
            if not (is_autopilot or self._all_components) or self._only not in (0, system):
                continue
            if self._signing is not None:
                refusal = self._signing.refusal(message.name, message.frame)
                if refusal is not None:
                    self.dropped[refusal] += 1
                    continue
            if is_autopilot and message.name in ("HEARTBEAT", "AUTOPILOT_VERSION"):
                self._identify(message, now_us)
            self._converse(message, now_us)
            messages.append(message)
        return messages

    def poll(self, now_us: int) -> list[bytes]:
        datagrams = []
        if self._heartbeat_every_us is not None and now_us >= (self._heartbeat_at_us or now_us):
            self._heartbeat_at_us = now_us + self._heartbeat_every_us
            own = (self._kind, AUTOPILOT_INVALID, 0, 0, STATE_ACTIVE, _MAVLINK_VERSION)
            datagrams.append(self._codec.encode("HEARTBEAT", *own))
        datagrams += self.poll_requests(now_us)
        for system, vehicle in self.vehicles.items():
            if not vehicle.lost and now_us - vehicle.heartbeat_us > LOST_AFTER_US:
                self.vehicles[system] = lost = vehicle._replace(lost=True)
                self._events.append(VehicleLost(lost))
        return datagrams

    def poll_requests(self, now_us: int) -> list[bytes]:
        datagrams = []
        for conversation in [lane[0] for lane in self._lanes.values()]:
            datagrams += [self._codec.encode(name, *fields) for name, fields in conversation.poll(now_us)]
            self._retire(conversation)
        return datagrams

    def take_events(self) -> list[Event]:
        events = list(self._events)
        self._events.clear()
        return events

    def _identify(self, message: Message, now_us: int) -> None:
        fields, system = message.fields, message.source[0]
        known = self.vehicles.get(system)
        if message.name == "AUTOPILOT_VERSION":
            if known is not None:
                uid2 = bytes(fields.uid2)
                self.vehicles[system] = known._replace(capabilities=int(fields.capabilities), uid2=uid2)
        elif fields.autopilot != AUTOPILOT_INVALID:
            met = RemoteVehicle(system, fields.autopilot, fields.type, now_us)
            if known is not None:
                met = met._replace(capabilities=known.capabilities, uid2=known.uid2)
            self.vehicles[system] = met
            if known is None or known.lost:
                self._events.append(VehicleFound(met))

    def _converse(self, message: Message, now_us: int) -> None:
        for conversation in [lane[0] for lane in self._lanes.values()]:
            answers = message.name in conversation.answers and message.source == conversation.target
            if answers and concerns(self.source, target_of(message.fields)):
                conversation.receive(message, now_us)
                self._retire(conversation)

    def _retire(self, conversation: Conversation) -> None:
        if conversation.result is not None:
            self.cancel(conversation)
            self._events.append(ConversationEnded(conversation))
