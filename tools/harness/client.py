"""A ground station of a vehicle in this process."""

from typing import Any

from colibri.autopilot.core.step import Received
from colibri.mavlink.client import client
from colibri.mavlink.client.inbox import Inbox

SYSTEM, COMPONENT = 1, 1  # of the vehicle
GCS_PORT, SDK_PORT = 14550, 14540


class HarnessClient(Inbox):
    """A ground station; received messages are in `Inbox`."""

    def __init__(self, system: int = 255, component: int = 190, port: int = GCS_PORT, link: int = 0) -> None:
        super().__init__(remembers=4000)
        self.component = component
        self.link = link
        self.address = ("127.0.0.1", port)
        self._client = client.Client(system, component, only=SYSTEM)
        self._to_send: list[bytes] = []

    def send(self, name: str, *fields: Any) -> None:
        self._to_send.append(self._client.encode(name, *fields))

    def send_raw(self, datagram: bytes) -> None:
        self._to_send.append(datagram)

    def take_sent(self) -> list[Received]:
        sent, self._to_send = self._to_send, []
        return [Received(datagram, self.link, self.address) for datagram in sent]

    def receive(self, datagram: bytes) -> None:
        for message in self._client.receive(datagram, 0):
            self.add(message)

    def forget(self) -> None:
        for kept in self.heard.values():
            del kept[:-1]
        self.acks.clear()
        self.texts.clear()
