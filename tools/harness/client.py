"""A ground station of a vehicle in this process: it encodes what it sends, and decodes what it receives."""

from typing import Any

from colibri.autopilot.core.step import Received
from colibri.mavlink.client import client
from colibri.mavlink.client.inbox import Inbox

SYSTEM, COMPONENT = 1, 1
"""Of the vehicle."""
GCS_PORT, SDK_PORT = 14550, 14540


class Client(Inbox):
    """A ground station, or whatever else speaks MAVLink to the vehicle; what it has received is in `Inbox`.

    Attributes:
        component: Its component id.
        link: Of the vehicle's, on which it is.
        address: Where the vehicle sees it.
    """

    def __init__(self, system: int = 255, component: int = 190, port: int = GCS_PORT, link: int = 0) -> None:
        """Be a component at a port of this computer."""
        super().__init__(remembers=4000)
        self.component = component
        self.link = link
        self.address = ("127.0.0.1", port)
        self._client = client.Client(system, component, only=SYSTEM)
        self._to_send: list[bytes] = []

    def send(self, name: str, *fields: Any) -> None:
        """Send a message with the next frame."""
        self._to_send.append(self._client.encode(name, *fields))

    def send_raw(self, datagram: bytes) -> None:
        """Send any bytes with the next frame."""
        self._to_send.append(datagram)

    def take_sent(self) -> list[Received]:
        """Return what is on its way to the vehicle, and forget it."""
        sent, self._to_send = self._to_send, []
        return [Received(datagram, self.link, self.address) for datagram in sent]

    def receive(self, datagram: bytes) -> None:
        """Decode what the vehicle sent."""
        for message in self._client.receive(datagram, 0):
            self.add(message)

    def forget(self) -> None:
        """Forget all but the latest of each message."""
        for kept in self.heard.values():
            del kept[:-1]
        self.acks.clear()
        self.texts.clear()
