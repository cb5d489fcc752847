"""Ground stations behind a conductor, which holds simulated time still: no clock decides what is received when."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

from colibri.autopilot.commander.rules.modes import State, custom_mode
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import Stations
from colibri.mavlink.hil.conductor import Gathering, Parcel, StepMessage, packets
from colibri.mavlink.links.udp import UdpLink
from colibri.mavlink.node.hub import Outgoing

HOST = "127.0.0.1"
"""Ground stations of a conductor have their number for a port here."""
_MAX_WAIT_S = 0.1


class Conductor(Protocol):
    """Stands for all ground stations, in lockstep with the vehicle."""

    def receive(self) -> StepMessage | None:
        """Return what they send at this instant; None where there will be nothing more."""

    def send(self, step_message: StepMessage) -> None:
        """Send them what the vehicle sends."""

    def close(self) -> None:
        """Let go."""


class UdpConductor:
    """A conductor in another process."""

    def __init__(self, link: UdpLink, ended: Callable[[], object]) -> None:
        """Speak with it on `link`, which it learns from an empty packet, until this process has `ended`."""
        self._link = link
        self._ended = ended
        self._gathering = Gathering()
        link.send(b"")

    def receive(self) -> StepMessage | None:
        """Wait for its step message."""
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
        """Send a step message."""
        for packet in packets(step_message):
            self._link.send(packet)

    def close(self) -> None:
        """Close the link."""
        self._link.close()


class SteppedLinks:
    """Carries datagrams between a conductor and a vehicle's hub."""

    def __init__(self, conductor: Conductor, state: Callable[[], State]) -> None:
        """Serve the ground stations of `conductor`, which receives the vehicle's `state` with each step message."""
        self._conductor = conductor
        self._state = state
        self._time_us = 0
        self._waiting: deque[Parcel] = deque()

    def introduce(self, stations: Stations) -> None:
        """Open nothing: each channel opens with the first message on it."""

    def receive(self, stations: Stations) -> Iterable[Received]:
        """Wait for what is sent at this instant, then yield it; what is not taken is yielded the next time."""
        del stations
        step_message = self._conductor.receive()
        if step_message is not None:
            self._time_us = step_message.time_us
            self._waiting.extend(step_message.parcels)
        return self._taken() if self._waiting else ()

    def send(self, outbox: Iterable[Outgoing]) -> None:
        """Send the conductor what the vehicle sends."""
        parcels = [Parcel(address[1], datagram) for _, address, datagram in outbox if address is not None]
        mode, armed = self._state()
        self._conductor.send(StepMessage(self._time_us, parcels, custom_mode(mode), armed))

    def facts(self, stations: Stations, interval_s: float) -> list[dict[str, Any]]:
        """Return nothing: nobody watches a terminal."""
        del stations, interval_s
        return []

    def take_notes(self) -> list[str]:
        """Return nothing: there is no device that could go."""
        return []

    def close(self) -> None:
        """Let go of the conductor."""
        self._conductor.close()

    def _taken(self) -> Iterator[Received]:
        while self._waiting:
            station, datagram = self._waiting.popleft()
            yield Received(datagram, 0, (HOST, station))
