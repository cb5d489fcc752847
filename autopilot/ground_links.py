"""The links to ground stations: what came on any of them, and where each answer goes."""

from collections.abc import Iterable, Sequence
from ipaddress import ip_address
from typing import Any

from autopilot.copter import Received
from autopilot.stations import Stations
from mavlink.channel import Address
from mavlink.hub import Outgoing
from mavlink.link import GroundLink, LinkError, beyond_loopback, open_ground_link, unsigned_refusal
from mavlink.services.rates import GCS, SDK

SDK_PORTS = range(14540, 14550)
"""Where SDKs wait for a PX4, and so for us: they ask for nothing, and expect everything."""


def open_links(urls: Sequence[str], *, signed: bool, insecure: bool) -> list[GroundLink]:
    """Open the links that `urls` name.

    Raises:
        LinkError: One cannot be opened, or would let anybody on the network fly the vehicle.
    """
    for url in urls:
        if beyond_loopback(url) and not (signed or insecure):
            raise LinkError(unsigned_refusal(url))
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
    """Carries datagrams between links and a vehicle's hub."""

    def __init__(self, links: Sequence[GroundLink]) -> None:
        """Serve `links`; those with a target are called, whether anybody hears it or not."""
        self._links = tuple(links)
        self._loopback = [not beyond_loopback(link.url) for link in links]
        self._opened: list[tuple[int, Address]] = []
        self._counts: dict[int, tuple[int, int]] = {}

    def introduce(self, stations: Stations) -> None:
        """Open a channel to everybody that is connected already."""
        for number, address in self._opened:
            self._open(stations, number, address)

    def _open(self, stations: Stations, number: int, address: Address) -> None:
        channel = stations.hub.open(number, address)
        stations.use(channel, SDK if address[1] in SDK_PORTS else GCS)

    def receive(self, stations: Stations) -> list[Received]:
        """Return what has come; forget connections that have ended."""
        inbox = []
        for number, link in enumerate(self._links):
            for address in link.take_opened():
                self._opened.append((number, address))
                self._open(stations, number, address)
            for datagram, address in link.receive_now():
                inbox.append(Received(datagram, number, address, self._is_loopback(number, address)))
            for address in link.take_closed():
                self._opened = [opened for opened in self._opened if opened != (number, address)]
                stations.hub.close(number, address)
        return inbox

    def send(self, outbox: Iterable[Outgoing]) -> None:
        """Send each datagram on its link; what cannot be sent is lost, as on any network."""
        for number, address, datagram in outbox:
            try:
                self._links[number].send(datagram, address)
            except LinkError:
                continue

    def facts(self, stations: Stations, interval_s: float) -> list[dict[str, Any]]:
        """Return, for each link, who is heard and how many messages a second come and go."""
        facts = []
        for number, link in enumerate(self._links):
            channels = [channel for channel in stations.hub.channels if channel.link == number]
            received, sent = (sum(getattr(channel, kind) for channel in channels) for kind in ("received", "sent"))
            before = self._counts.get(number, (0, 0))
            self._counts[number] = (received, sent)
            facts.append(
                {
                    "url": link.url,
                    "heard": [f"{system}/{component}" for channel in channels for system, component in channel.sources],
                    "received_hz": max(received - before[0], 0) / interval_s,
                    "sent_hz": max(sent - before[1], 0) / interval_s,
                    "lost": sum(channel.lost for channel in channels),
                }
            )
        return facts

    def close(self) -> None:
        """Close every link."""
        for link in self._links:
            link.close()

    def _is_loopback(self, number: int, address: Address) -> bool:
        return self._loopback[number] or ip_address(address[0]).is_loopback
