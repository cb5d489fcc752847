"""What is on the two sides of a hub: services that hear it, and somebody at the other end of a link."""

from collections.abc import Iterable
from typing import Any

from colibri.mavlink.node.hub import Hub
from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.services.shell import DATA_BYTES, Shell
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec, Message

HEARTBEAT = (6, 8, 0, 0, 4, 3)
GCS, SDK = ("127.0.0.1", 14550), ("127.0.0.1", 14540)


class Recorder:
    """A service that hears everything and answers PINGs."""

    handles = frozenset(definition.msgname for definition in dialect.mav.mavlink_map.values())

    def __init__(self) -> None:
        self.received: list[tuple[str, Peer, int]] = []
        self.due: list[Send] = []

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        self.received.append((message.name, peer, now_us))
        return [to(peer, "PING", 7, 8, *message.source)] if message.name == "PING" else ()

    def poll(self, now_us: int) -> Iterable[Send]:
        assert now_us >= 0
        due, self.due = self.due, []
        return due

    @property
    def names(self) -> list[str]:
        return [name for name, _, _ in self.received]


class CountedShell(Shell):
    polls = 0

    def poll(self, now_us: int) -> Iterable[Send]:
        self.polls += 1
        return super().poll(now_us)


def typed(text: bytes) -> tuple[object, ...]:
    device, flags = dialect.mav.SERIAL_CONTROL_DEV_SHELL, dialect.mav.SERIAL_CONTROL_FLAG_RESPOND
    return device, flags, 0, 0, len(text[:DATA_BYTES]), text[:DATA_BYTES].ljust(DATA_BYTES, b"\0")


class Observer:
    def __init__(self) -> None:
        self.open: list[int] = []
        self.told: list[tuple[str, int]] = []

    def opened(self, channel: int, now_us: int) -> None:
        assert now_us >= 0
        self.open.append(channel)
        self.told.append(("opened", channel))

    def closed(self, channel: int) -> None:
        self.open.remove(channel)
        self.told.append(("closed", channel))


class Station:
    def __init__(self, system: int = 255, component: int = 190) -> None:
        self.codec = Codec(system, component)

    def says(self, name: str = "HEARTBEAT", *fields: Any) -> bytes:
        return self.codec.encode(name, *(fields or HEARTBEAT))


def sent(ours: Hub) -> list[tuple[int, Any, list[str]]]:
    return [
        (out.link, out.address, [message.name for message in Codec(9, 9).decode(out.datagram)])
        for out in ours.take_outbox()
    ]


def frames_to(ours: Hub, address: Any) -> bytes:
    return b"".join(out.datagram for out in ours.take_outbox() if out.address == address)
