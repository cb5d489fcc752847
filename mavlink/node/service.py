"""What every microservice is: messages and the simulated time in, messages to send out.

A service receives only messages to this component or to all, from another component: the hub filters them.
Whatever the fields hold, `receive` and `poll` raise nothing. Nobody has checked the values: NaN, infinities, unknown
enumerations and lies about counts are the service's to refuse.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple, Protocol, TypeAlias, runtime_checkable

from colibri.mavlink.wire.dialect import Message

Fields: TypeAlias = tuple[Any, ...]
"""A message's fields in the order of its MAVLink definition, in wire units and frames."""


class Peer(NamedTuple):
    """Who sent a message, and the number of the channel (a remote address on a link) that an answer takes."""

    channel: int
    system: int
    component: int


class Send(NamedTuple):
    """A message to send.

    Attributes:
        name: Message name as MAVLink has it, "COMMAND_ACK".
        channel: The channel to take; None for all of them.
    """

    name: str
    fields: Fields
    channel: int | None = None


IDLE: Final[Sequence[Send]] = []
"""Nothing, of a service that has nothing under way either: it is not polled again before it receives a message."""


class Service(Protocol):
    """A microservice, and the names of the messages that its `receive` is to be given."""

    handles: frozenset[str]

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Take in one message; return what to send at once."""


@runtime_checkable
class PolledService(Service, Protocol):
    """A microservice that sends by itself, or later than it received."""

    def poll(self, now_us: int) -> Iterable[Send]:
        """Do what is due at `now_us`; return what to send, or `IDLE`. Called once a frame of the plant."""


def to(peer: Peer, name: str, *fields: Any) -> Send:
    """Return a message to `peer`."""
    return Send(name, fields, peer.channel)


def to_all(name: str, *fields: Any) -> Send:
    """Return a message to all channels."""
    return Send(name, fields)
