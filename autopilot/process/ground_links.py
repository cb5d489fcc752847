"""The links to ground stations."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from colibri.autopilot.control.interface import Clock
from colibri.autopilot.core.step import Received
from colibri.autopilot.ground.stations import Stations
from colibri.common.types import Address
from colibri.mavlink.links.link import GroundLink, LinkError
from colibri.mavlink.links.open import calls_this_computer, check_reach, open_ground_link
from colibri.mavlink.node.channel import Channel
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.node.router import Source
from colibri.mavlink.streaming.rates import GCS, SDK

SDK_PORTS = range(14540, 14550)  # ports where SDKs wait for PX4; they request no streams, and expect all
SHARE = 0.25  # part of all time for receiving: the control law leaves more than half of a frame idle
MAX_SAVED_S = 0.005
_GONE_AFTER_S = 3.5  # wall-clock time; ground stations send a HEARTBEAT every second


def open_links(urls: Sequence[str], *, signed: bool, insecure: bool) -> list[GroundLink]:
    """Open all links, or raise LinkError; networks require signing or `insecure`."""
    check_reach(urls, signed=signed, insecure=insecure)
    links: list[GroundLink] = []
    try:
        for url in urls:
            links.append(open_ground_link(url))
    except LinkError:
        for link in links:
            link.close()
        raise
    return links


class GroundLinks:
    """Carries datagrams between links and a vehicle's hub.

    The owner, who may set up the key, is on the first link, if it calls this computer: any program, and some web
    pages, reach a port that waits.
    """

    def __init__(self, links: Sequence[GroundLink], clock: Clock, processor_clock: Clock) -> None:
        self._links = tuple(links)
        self._waiting: list[deque[tuple[bytes, Address]]] = [deque() for _ in links]
        self._clock, self._processor_clock = clock, processor_clock
        self._earned_s, self._left_s = clock(), MAX_SAVED_S  # processor time left for datagrams
        self._owner = bool(links) and calls_this_computer(links[0].url)
        self._opened: list[tuple[int, Address]] = []
        self._counts: dict[int, tuple[int, int]] = {}
        self._last: dict[tuple[int, Source], tuple[int, float]] = {}

    def introduce(self, stations: Stations) -> None:
        for number, address in self._opened:
            self._open(stations, number, address)

    def _open(self, stations: Stations, number: int, address: Address) -> None:
        channel = stations.hub.open(number, address)
        stations.streams.use(channel, SDK if address[1] in SDK_PORTS else GCS)

    def receive(self, stations: Stations) -> Iterator[Received]:
        """Yield datagrams within the time budget."""
        now_s = self._clock()
        self._left_s = min(self._left_s + SHARE * (now_s - self._earned_s), MAX_SAVED_S)
        self._earned_s = now_s
        for number, link in enumerate(self._links):
            if not self._waiting[number]:
                self._waiting[number].extend(link.receive_now())
            for address in link.take_opened():
                self._opened.append((number, address))
                self._open(stations, number, address)
        yield from self._in_turn()
        for number, link in enumerate(self._links):
            for address in link.take_closed():
                self._forget(stations, number, address)

    def _in_turn(self) -> Iterator[Received]:
        """Yield from the links in turn, as one may be flooded."""
        while any(self._waiting):
            for number, waiting in enumerate(self._waiting):
                if not waiting:
                    continue
                began_s = self._processor_clock()
                if self._left_s <= 0.0:
                    return
                datagram, address = waiting.popleft()
                yield Received(datagram, number, address, self._owner and number == 0)
                self._left_s -= self._processor_clock() - began_s

    def _forget(self, stations: Stations, number: int, address: Address) -> None:
        self._opened = [opened for opened in self._opened if opened != (number, address)]
        self._waiting[number] = deque(each for each in self._waiting[number] if each[1] != address)
        stations.hub.close(number, address)

    def send(self, outbox: Iterable[Outgoing]) -> None:
        """Send each datagram; failures are lost datagrams."""
        began_s = self._processor_clock()
        for outgoing in outbox:
            try:
                self._links[outgoing.link].send(outgoing.datagram, outgoing.address)
            except LinkError:
                continue
        self._left_s -= self._processor_clock() - began_s

    def facts(self, stations: Stations, interval_s: float) -> list[dict[str, Any]]:
        facts = []
        for number, link in enumerate(self._links):
            channels = [channel for channel in stations.hub.channels if channel.link == number]
            received, sent = (sum(getattr(channel, kind) for channel in channels) for kind in ("received", "sent"))
            before = self._counts.get(number, (0, 0))
            self._counts[number] = (received, sent)
            facts.append(
                {
                    "url": link.url,
                    "heard": [
                        f"{system}/{component}" for channel in channels for system, component in self._there(channel)
                    ],
                    "received_hz": max(received - before[0], 0) / interval_s,
                    "sent_hz": max(sent - before[1], 0) / interval_s,
                    "lost": sum(channel.lost for channel in channels),
                }
            )
        return facts

    def _there(self, channel: Channel) -> Iterator[Source]:
        now_s = self._clock()
        for source, received_us in channel.sources_us.items():
            before_us, since_s = self._last.get((channel.number, source), (-1, now_s))
            if received_us != before_us:
                since_s = now_s
                self._last[channel.number, source] = received_us, now_s
            if now_s < since_s + _GONE_AFTER_S:
                yield source

    def take_notes(self) -> list[str]:
        return [note for link in self._links for note in link.take_notes()]

    def close(self) -> None:
        for link in self._links:
            link.close()
