"""The interface of a microservice: messages and the simulated time in, messages out.

A service receives messages to this component or to all. Field values are unchecked: NaN, infinities, unknown
enumerations and wrong counts must be refused, and never raise.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple, Protocol, TypeAlias, runtime_checkable

from colibri.mavlink.wire.dialect import Message

Fields: TypeAlias = tuple[Any, ...]  # in the order of the MAVLink definition, in wire units and frames


class Peer(NamedTuple):
    """A sender, on the channel of that number."""

    channel: int
    system: int
    component: int


def first_to_go(peers: Iterable[Peer]) -> Peer:
    """Return the first peer of the channel that has most: no channel pushes out the others."""
    waiting = list(peers)
    ((channel, _),) = Counter(peer.channel for peer in waiting).most_common(1)
    return next(peer for peer in waiting if peer.channel == channel)


class Send(NamedTuple):
    name: str
    fields: Fields
    channel: int | None = None  # `None` for all


IDLE: Final[Sequence[Send]] = []  # result of a service that is not polled again before it receives a message


class Service(Protocol):
    """A microservice for the messages in `handles`."""

    handles: frozenset[str]

    def receive(self, message: Message, peer: Peer, now_us: int, /) -> Iterable[Send]: ...


@runtime_checkable
class PolledService(Service, Protocol):
    """A microservice that also sends by itself, or later."""

    def poll(self, now_us: int, /) -> Iterable[Send]:
        """Return the due messages, or `IDLE`; called at every frame of the plant."""


def to(peer: Peer, name: str, *fields: Any) -> Send:
    return Send(name, fields, peer.channel)


def to_all(name: str, *fields: Any) -> Send:
    return Send(name, fields)
