"""The hub of all links: checks, routes and dispatches messages, sends answers."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

from colibri.common.records import Record
from colibri.common.types import Address
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.node.channel import Channel
from colibri.mavlink.node.router import Source, concerns, onward, target_of
from colibri.mavlink.node.service import IDLE, Peer, PolledService, Send, Service
from colibri.mavlink.wire.dialect import UNKNOWN, Codec, Message
from colibri.mavlink.wire.signing import TOO_EARLY, Signing

CHANNELS = 32  # limit: the longest silent or else the newest one that is not fixed is replaced
SILENT_AFTER_US = 3_500_000  # stations send a HEARTBEAT every second, so no flood replaces them
FORGET_AFTER_US = 300_000_000  # silence before an unfixed channel is closed: sending to it costs time
_TIDY_EVERY_US = 1_000_000
_OPENS_NOTHING = frozenset({UNKNOWN, "RADIO_STATUS"})  # messages without a verifiable CRC or signature


_HANDLED_US, _ANSWERED_US = 20.0, 8.0  # work for a message that a service handles, and for each one sent in answer
MAX_WAITING = 1000  # limit of messages of one channel that wait for the budget; more are dropped
_TRIES = 3  # exceptions in `poll` before a service is switched off
Caught: TypeAlias = Callable[[str, Exception, str], None]  # (service, exception, consequence)
WARN_EVERY_US = 10_000_000  # interval of the warning of a refused key or signature
FUTURE = "a signature is ahead of this computer's clock by more than 30 s: set the sender's clock"
KEY_REFUSED = (
    "a signing key is refused: it is taken from the first --gcs only, if that is udpout: or tcp: to this computer; "
    "or start with --signing-key FILE"
)


class Outgoing(Record, frozen=True):
    """A datagram and its link's number; without address, the link chooses."""

    link: int
    address: Address | None
    datagram: bytes


@runtime_checkable
class ChannelObserver(Protocol):
    """Observer of channels; numbers are never reused."""

    def opened(self, channel: int, now_us: int) -> None: ...

    def closed(self, channel: int) -> None: ...


class Hub:
    """A component on any number of links; a channel opens with the first valid message of a remote address."""

    def __init__(
        self,
        system_id: int,
        component_id: int,
        services: Sequence[Service],
        *,
        signing: Signing | None = None,
        observers: Sequence[ChannelObserver] = (),
        caught: Caught | None = None,
        warn: Callable[[str], None] | None = None,
        budget: Budget | None = None,
    ) -> None:
        """Create a component; `caught` takes services' exceptions, messages beyond the `budget` wait for `work`."""
        self._budget = budget or Budget()
        self.waiting: dict[int, deque[Message]] = {}
        self._own = (system_id, component_id)
        self._polled = tuple(service for service in services if isinstance(service, PolledService))
        self._awake = self._polled
        self._idle: set[Service] = set()
        names = frozenset[str]().union(*(service.handles for service in services))
        self._receivers = {name: [service for service in services if name in service.handles] for name in names}
        self._signing = signing
        self._observers = tuple(observers)
        self._sources: dict[int, dict[Source, int]] = {}  # received on each channel
        self._strangers = Codec(*self._own, keep_unknown=True)
        self._channels: dict[int, Channel] = {}
        self._numbers: dict[tuple[int, Address | None], int] = {}
        self._next_number = 0
        self.accepts_only: frozenset[str] | None = None  # messages dispatched to services
        self._now_us = 0
        self._tidy_at_us = 0
        self._dropped_before: Counter[str] = Counter()
        self._caught, self._warn = caught, warn
        self._warn_at_us: dict[str, int] = {}
        self._raised: Counter[Service] = Counter()

    @property
    def channels(self) -> tuple[Channel, ...]:
        return tuple(self._channels.values())

    @property
    def dropped(self) -> Counter[str]:
        total = self._dropped_before + self._strangers.dropped
        for channel in self._channels.values():
            total += channel.codec.dropped
        return total

    def open(self, link: int, address: Address | None) -> int:
        """Open a fixed channel and return its number; without address, for the whole link."""
        number = self._numbers.get((link, address))
        channel = self._open(link, address) if number is None else self._channels[number]
        channel.fixed = True
        return channel.number

    def close(self, link: int, address: Address) -> None:
        number = self._numbers.get((link, address))
        if number is not None:
            self._forget(number)

    def receive(self, datagram: bytes, link: int, address: Address | None, now_us: int, *, owner: bool = True) -> None:
        """Handle a datagram; an `owner` may set up signing."""
        self._now_us = now_us
        number = self._numbers.get((link, address), self._numbers.get((link, None)))
        channel = None if number is None else self._channels[number]
        codec = self._strangers if channel is None else channel.codec
        for message in codec.decode(datagram):
            reason = self._refusal(message, known=channel is not None)
            if reason is not None:
                codec.dropped[reason] += 1
                continue
            channel = channel or self._admit(link, address)
            if channel is None:
                codec.dropped["no room"] += 1
                continue
            self._take_in(message, channel, owner)

    def work(self, now_us: int) -> None:
        """Handle waiting messages, one of each channel in turn, within the budget."""
        self._now_us = now_us
        while self.waiting and self._budget.allows(now_us):
            number = next(iter(self.waiting))
            waiting = self.waiting.pop(number)
            message = waiting.popleft()
            if waiting:
                self.waiting[number] = waiting  # at the end of the line
            self._handle(message, number)

    def poll(self, now_us: int) -> None:
        self._now_us = now_us
        for service in self._awake:
            try:
                sends = service.poll(now_us)
                if sends:
                    self.send(sends)
                elif sends is IDLE:
                    self._idle.add(service)
                    self._choose()
            except Exception as error:
                self._raised[service] += 1
                self._tell(service, error, "tried again, then off")
                if self._raised[service] >= _TRIES:
                    self._polled = tuple(each for each in self._polled if each is not service)
                    self._choose()
        if now_us >= self._tidy_at_us:
            self._tidy_at_us = now_us + _TIDY_EVERY_US
            for channel in self.channels:
                if not channel.fixed and now_us - channel.active_us > FORGET_AFTER_US:
                    self._forget(channel.number)

    def send(self, sends: Iterable[Send]) -> int:
        """Send messages; return how many were encoded."""
        sent = 0
        for name, fields, number in sends:
            if number is None:
                sent += len(self._channels)
                for channel in self._channels.values():
                    channel.say(channel.codec.encode(name, *fields))
            elif number in self._channels:
                sent += 1
                channel = self._channels[number]
                channel.say(channel.codec.encode(name, *fields))
        return sent

    def take_outbox(self) -> list[Outgoing]:
        channels = self._channels.values()
        return [Outgoing(each.link, each.address, datagram) for each in channels for datagram in each.take()]

    def _refusal(self, message: Message, *, known: bool) -> str | None:
        if message.source == self._own:
            return "echo"
        if not known and message.name in _OPENS_NOTHING:
            return "stranger"
        if self._signing is None:
            return None
        reason = self._signing.refusal(message.name, message.frame)
        if reason is TOO_EARLY:
            self._warn_of(FUTURE)
        return reason

    def _take_in(self, message: Message, channel: Channel, owner: bool) -> None:
        if message.name == UNKNOWN:  # its CRC may be wrong, so nothing is learned from it
            self._forward(message, (0, 0), channel)
            return
        channel.receive(message, self._now_us)
        target = target_of(message.fields)
        if message.name == "SETUP_SIGNING":  # "must never be automatically forwarded", message_signing.html
            self._set_up_signing(message, target, channel, owner)
            return
        self._forward(message, target, channel)
        if concerns(self._own, target) and message.name in self._receivers:
            self._queue(message, channel)

    def _queue(self, message: Message, channel: Channel) -> None:
        waiting = self.waiting.get(channel.number)
        if waiting is None and self._budget.allows(self._now_us):
            self._handle(message, channel.number)
        elif waiting is None:
            self.waiting[channel.number] = deque((message,))
        elif len(waiting) < MAX_WAITING:
            waiting.append(message)
        else:
            channel.codec.dropped["too many at once"] += 1

    def _handle(self, message: Message, number: int) -> None:
        if self.accepts_only is not None and message.name not in self.accepts_only:
            return
        self._budget.spend(_HANDLED_US)
        peer = Peer(number, *message.source)
        for service in self._receivers[message.name]:
            if service in self._idle:
                self._idle.discard(service)
                self._choose()
            try:
                self._budget.spend(_ANSWERED_US * self.send(service.receive(message, peer, self._now_us)))
            except Exception as error:
                self._tell(service, error, f"{message.name} dropped")

    def _choose(self) -> None:
        self._awake = tuple(service for service in self._polled if service not in self._idle)

    def _tell(self, service: Service, error: Exception, instead: str) -> None:
        if self._caught is None:
            raise error
        self._caught(type(service).__name__, error, instead)

    def _forward(self, message: Message, target: tuple[int, int], channel: Channel) -> None:
        for number in onward(self._sources, message.source, target, channel.number):
            self._channels[number].say(message.frame)

    def _set_up_signing(self, message: Message, target: tuple[int, int], channel: Channel, owner: bool) -> None:
        fields, signing = message.fields, self._signing
        addressed = target[0] == self._own[0] and concerns(self._own, target)
        if addressed and not owner:
            self._warn_of(KEY_REFUSED)
        key = bytes(fields.secret_key)
        if not (signing and owner and addressed and signing.set_up(key, fields.initial_timestamp)):
            channel.codec.dropped["signing not set up"] += 1
            return
        for each in self._channels.values():
            self._seal(each)

    def _warn_of(self, text: str) -> None:
        if self._warn is not None and self._now_us >= self._warn_at_us.get(text, 0):
            self._warn_at_us[text] = self._now_us + WARN_EVERY_US
            self._warn(text)

    def _seal(self, channel: Channel) -> None:
        signing = self._signing
        if signing is None or not signing.active:
            channel.codec.seal = None
        else:
            channel.codec.seal = lambda frame: signing.sign(frame, channel.number)

    def _admit(self, link: int, address: Address | None) -> Channel | None:
        if len(self._channels) >= CHANNELS:
            passing = [channel for channel in self._channels.values() if not channel.fixed]
            if not passing:
                return None
            silent = min(passing, key=lambda channel: channel.active_us)
            is_silent = self._now_us - silent.active_us >= SILENT_AFTER_US
            self._forget(silent.number if is_silent else passing[-1].number)
        return self._open(link, address)

    def _open(self, link: int, address: Address | None) -> Channel:
        codec = Codec(*self._own, keep_unknown=True)
        channel = Channel(self._next_number, link, address, codec, self._now_us)
        self._next_number += 1
        self._channels[channel.number] = channel
        self._numbers[link, address] = channel.number
        self._sources[channel.number] = channel.sources_us
        self._seal(channel)
        for observer in self._observers:
            observer.opened(channel.number, self._now_us)
        return channel

    def _forget(self, number: int) -> None:
        channel = self._channels.pop(number)
        self.waiting.pop(number, None)
        del self._numbers[channel.link, channel.address]
        del self._sources[number]
        self._dropped_before += channel.codec.dropped
        for observer in self._observers:
            observer.closed(number)
