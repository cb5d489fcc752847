"""Ground stations behind a conductor, which stops simulated time."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

from colibri.autopilot.commander.rules.modes import State, custom_mode
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import Stations
from colibri.mavlink.hil.conductor import Gathering, Parcel, StepMessage, packets
from colibri.mavlink.links.udp import UdpLink
from colibri.mavlink.node.hub import Outgoing

HOST = "127.0.0.1"  # the ports of a conductor's ground stations are their numbers
_MAX_WAIT_S = 0.1


class Conductor(Protocol):
    """Represents all ground stations, in lockstep with the vehicle."""

    def receive(self) -> StepMessage | None: ...

    def send(self, step_message: StepMessage) -> None: ...

    def close(self) -> None: ...


class UdpConductor:
    def __init__(self, link: UdpLink, ended: Callable[[], object]) -> None:
        self._link = link
        self._ended = ended
        self._gathering = Gathering()
        link.send(b"")

    def receive(self) -> StepMessage | None:
        while True:
            received = self._link.receive(_MAX_WAIT_S)
            if received is None:
                if self._ended():
                    return None
                continue
            step_message = self._gathering.take(received[0])
            if step_message is not None:
                return step_message

    def send(self, step_message: StepMessage) -> None:
        for packet in packets(step_message):
            self._link.send(packet)

    def close(self) -> None:
        self._link.close()


class SteppedLinks:
    """Carries datagrams between a conductor and a vehicle's hub."""

    def __init__(self, conductor: Conductor, state: Callable[[], State]) -> None:
        self._conductor = conductor
        self._state = state
        self._time_us = 0
        self._waiting: deque[Parcel] = deque()

    def introduce(self, stations: Stations) -> None:
        """Channels open with their first message."""

    def receive(self, _stations: Stations) -> Iterable[Received]:
        """Wait for the messages of this instant; untaken ones remain."""
        step_message = self._conductor.receive()
        if step_message is not None:
            self._time_us = step_message.time_us
            self._waiting.extend(step_message.parcels)
        return self._taken() if self._waiting else ()

    def send(self, outbox: Iterable[Outgoing]) -> None:
        parcels = [Parcel(it.address[1], it.datagram) for it in outbox if it.address is not None]
        mode, armed = self._state()
        self._conductor.send(StepMessage(self._time_us, parcels, custom_mode(mode), armed))

    def facts(self, _stations: Stations, _interval_s: float) -> list[dict[str, Any]]:
        """Empty: stepped flights have no terminal."""
        return []

    def take_notes(self) -> list[str]:
        """Empty: this link cannot lose a device."""
        return []

    def close(self) -> None:
        self._conductor.close()

    def _taken(self) -> Iterator[Received]:
        while self._waiting:
            station, datagram = self._waiting.popleft()
            yield Received(datagram, 0, (HOST, station))
