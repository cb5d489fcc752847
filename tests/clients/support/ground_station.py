"""A ground station of pymavlink alone, none of our code between it and the vehicle."""

import socket
from collections import deque
from collections.abc import Callable, Iterable
from math import nan
from select import select
from time import monotonic
from typing import Any, Self, TypeAlias

from pymavlink.dialects.v20 import development as mavlink2

from colibri.common.types import Address
from tools.harness.observer import Observer, Sight

GIVE_UP_AFTER_S = 60.0

Message: TypeAlias = Any

_MAX_DATAGRAM_BYTES = 4096
_HEARTBEAT_EVERY_S = 1.0


class GroundStation:
    """Waits on a port for vehicles that call, as QGroundControl does on 14550, and speaks to all that have called."""

    def __init__(self, system_id: int = 255, component_id: int = 190, port: int = 0, *, announced: bool = True) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self.mav = mavlink2.MAVLink(self, system_id, component_id)
        self.mav.robust_parsing = True
        self.heard: list[Message] = []
        self.peers: list[Address] = []
        self._tell: Callable[[bytes], None] = lambda _: None
        self._unread: deque[Message] = deque()
        self._announced = announced
        self._heartbeat_due_s = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    @property
    def url(self) -> str:
        return f"udpout:127.0.0.1:{self.port}"

    def write(self, datagram: bytes) -> None:
        self._tell(datagram)
        for peer in self.peers:
            self._socket.sendto(datagram, peer)

    def listen_to_sent(self, listener: Callable[[bytes], None]) -> None:
        self._tell = listener

    def call(self, port: int) -> None:
        self.peers.append(("127.0.0.1", port))

    def pump(self, within_s: float = 0.05) -> list[Message]:
        if self._announced and self.peers and monotonic() >= self._heartbeat_due_s:
            self._heartbeat_due_s = monotonic() + _HEARTBEAT_EVERY_S
            self.mav.heartbeat_send(mavlink2.MAV_TYPE_GCS, mavlink2.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        if not select([self._socket], [], [], within_s)[0]:
            return []
        datagram, sender = self._socket.recvfrom(_MAX_DATAGRAM_BYTES)
        if sender not in self.peers:
            self.peers.append(sender)
        came = self.mav.parse_buffer(datagram) or []
        self.heard += came
        return list(came)

    def wait(
        self, name: str, condition: Callable[[Message], bool] = lambda _: True, *, within_s: float = GIVE_UP_AFTER_S
    ) -> Message:
        """Return the next message `name` that meets `condition`.

        Raises:
            AssertionError: None came, within a wall-clock bound for what hangs.
        """
        give_up_s = monotonic() + within_s
        while monotonic() < give_up_s:
            self._unread += self.pump() if not self._unread else ()
            while self._unread:
                message = self._unread.popleft()
                if message.get_type() == name and condition(message):
                    return message
        said = [message.text for message in self.heard if message.get_type() == "STATUSTEXT"]
        raise AssertionError(f"waited in vain for {name}; the vehicle said {said}")

    def until(
        self, seen: Observer, condition: Callable[[Sight], bool], what: str, within_s: float = GIVE_UP_AFTER_S
    ) -> Sight:
        give_up_s = monotonic() + within_s
        while not condition(sight := seen.now):
            assert monotonic() < give_up_s, f"waited in vain for {what}; {sight}; {seen.texts}"
            self.pump(0.02)
        return sight

    def command(self, number: int, *values: float, system: int = 1, component: int = 1) -> int:
        """Send COMMAND_LONG, what is not given as NaN; return the result of its acknowledgement."""
        parameters = (*values, *(nan for _ in range(7 - len(values))))
        self.mav.command_long_send(system, component, number, 0, *parameters)
        return self._acknowledged(number, system)

    def command_int(
        self, number: int, frame: int, four: Iterable[float], x: int, y: int, z: float, *, system: int = 1
    ) -> int:
        self.mav.command_int_send(system, 1, frame, number, 0, 0, *four, x, y, z)
        return self._acknowledged(number, system)

    def ask(self, number: int, name: str, p2: float = 0.0) -> Message:
        """Ask for message `number` as QGroundControl does; return it, the acknowledgement having come first."""
        request = mavlink2.MAV_CMD_REQUEST_MESSAGE
        self.mav.command_long_send(1, 1, request, 0, number, p2, 0, 0, 0, 0, 0)
        before = len(self.heard)
        self.wait(name)
        acks = [m for m in self.heard[before:] if m.get_type() == "COMMAND_ACK" and m.command == request]
        result = acks[0].result if acks else self._acknowledged(request, 1)
        assert result == mavlink2.MAV_RESULT_ACCEPTED
        return next(message for message in self.heard[before:] if message.get_type() == name)

    def _acknowledged(self, number: int, system: int) -> int:
        own = (self.mav.srcSystem, self.mav.srcComponent)
        ack = self.wait(
            "COMMAND_ACK",
            lambda ack: (
                ack.command == number
                and ack.get_srcSystem() == system
                and (ack.target_system, ack.target_component) == own
                and ack.result != mavlink2.MAV_RESULT_IN_PROGRESS
            ),
        )
        return int(ack.result)
