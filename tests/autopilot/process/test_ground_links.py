from collections import Counter

import pytest

from colibri.autopilot.ground.stations import Stations
from colibri.autopilot.process.ground_links import MAX_SAVED_S, SHARE, GroundLinks
from colibri.common.types import Address
from colibri.mavlink.node.hub import KEY_REFUSED
from colibri.mavlink.wire.dialect import Codec
from colibri.sitl.vehicle import Sitl
from tests.support.clock import Clock

pytestmark = pytest.mark.sitl(ready=False)
HEARTBEAT = Codec(255, 190).encode("HEARTBEAT", 6, 8, 0, 0, 4, 3)
HERE: Address = ("127.0.0.1", 5)
FRAME_S = 0.004


class FakeLink:
    def __init__(self, number: int, waiting: int) -> None:
        self.url = f"tcpin:127.0.0.1:{number + 1}"
        self.target = None
        self.waiting = waiting
        self.here = HERE
        self.notes: list[str] = []
        self.opened: list[Address] = []
        self.closed: list[Address] = []

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        pass

    def receive_now(self) -> list[tuple[bytes, Address]]:
        taken = min(self.waiting, 64)
        self.waiting -= taken
        return [(HEARTBEAT, self.here)] * taken

    def wait(self, timeout_s: float) -> None:
        pass

    def take_opened(self) -> list[Address]:
        opened, self.opened = self.opened, []
        return opened

    def take_closed(self) -> list[Address]:
        closed, self.closed = self.closed, []
        return closed

    def take_notes(self) -> list[str]:
        notes, self.notes = self.notes, []
        return notes

    def close(self) -> None:
        pass


@pytest.fixture
def stations(sitl: Sitl) -> Stations:
    return sitl.inside.copter.stations


def heard_in_a_frame(links: GroundLinks, stations: Stations, clock: Clock, takes_s: float) -> Counter[int]:
    heard: Counter[int] = Counter()
    for received in links.receive(stations):
        heard[received.link] += 1
        clock.now_s += takes_s
    return heard


@pytest.mark.parametrize("takes_s", [1e-5, 1e-3, 2e-2])
def test_a_flood_takes_its_share_of_the_time_and_no_more(stations: Stations, takes_s: float) -> None:
    clock = Clock()
    links = GroundLinks([FakeLink(0, 10**9)], clock, clock)
    spent_s = 0.0
    while clock.now_s < 10.0:
        spent_s += takes_s * heard_in_a_frame(links, stations, clock, takes_s).total()
        clock.now_s += FRAME_S
    assert 0.5 * SHARE * clock.now_s < spent_s < SHARE * clock.now_s + MAX_SAVED_S + takes_s


def test_a_flooded_link_is_not_heard_before_others(stations: Stations) -> None:
    clock = Clock()
    links = GroundLinks([FakeLink(0, 10**9), FakeLink(1, 10)], clock, clock)
    heard: Counter[int] = Counter()
    for _ in range(40):
        heard += heard_in_a_frame(links, stations, clock, 5e-4)
        clock.now_s += FRAME_S
    assert heard[1] == 10
    assert heard[0] > 10


def test_the_last_bytes_of_a_connection_are_processed(stations: Stations) -> None:
    clock = Clock()
    link = FakeLink(0, 3)
    links = GroundLinks([link], clock, clock)
    before = len(stations.hub.channels)
    link.opened, link.closed = [HERE], [HERE]
    for received in links.receive(stations):
        stations.hub.receive(received.datagram, received.link, received.address, 0)
        assert len(stations.hub.channels) == before + 1
    assert len(stations.hub.channels) == before


def test_a_connection_that_ends_drops_its_pending_data(stations: Stations) -> None:
    clock = Clock()
    link = FakeLink(0, 50)
    links = GroundLinks([link], clock, clock)
    link.opened, link.closed = [HERE], [HERE]
    assert heard_in_a_frame(links, stations, clock, 1.0) == {0: 1}
    clock.now_s += 100.0
    assert not heard_in_a_frame(links, stations, clock, 1.0)


def test_a_busy_computer_makes_nobody_deaf(stations: Stations) -> None:
    """Time that other processes take, while a datagram is heard or sent, is not spent by who sent it."""
    clock, processor_clock = Clock(), Clock()
    link = FakeLink(0, 0)
    links = GroundLinks([link], clock, processor_clock)
    for _ in range(20):
        link.waiting = 1
        heard = 0
        for _ in links.receive(stations):
            heard += 1
            clock.now_s += 0.2
            processor_clock.now_s += 1e-4
        assert heard == 1
        clock.now_s += FRAME_S


def test_who_is_silent_is_heard_no_more(stations: Stations) -> None:
    clock, link = Clock(), FakeLink(0, 1)
    links = GroundLinks([link], clock, clock)

    def there() -> list[str]:
        for datagram, number, address, owner in links.receive(stations):
            stations.hub.receive(datagram, number, address, round(clock.now_s * 1e6), owner=owner)
        (fact,) = links.facts(stations, 0.5)
        heard: list[str] = fact["heard"]
        return heard

    assert there() == ["255/190"]
    clock.now_s = 3.0
    assert there() == ["255/190"]
    clock.now_s = 4.0
    assert there() == []
    link.waiting = 1
    assert there() == ["255/190"]


@pytest.mark.parametrize(("url", "owner"), [
    ("udpout:127.0.0.1:14550", True),
    ("tcp:127.0.0.1:5760", True),
    ("udpin:127.0.0.1:14550", False),
    ("tcpin:127.0.0.1:5760", False),
    ("udpout:192.0.2.1:14550", False),
    ("serial:/dev/ttyACM0:57600", False),
])  # fmt: skip
def test_who_is_called_first_on_this_computer_is_the_owner(stations: Stations, url: str, owner: bool) -> None:
    links = [FakeLink(0, 1), FakeLink(1, 1)]
    links[0].url, links[1].url = url, "udpout:127.0.0.1:14540"
    received = GroundLinks(links, Clock(), Clock()).receive(stations)
    assert [each.owner for each in received] == [owner, False]


def test_a_refused_key_is_reported_with_where_it_is_allowed(stations: Stations) -> None:
    link = FakeLink(0, 0)
    key = Codec(255, 190).encode("SETUP_SIGNING", 1, 1, list(range(32)), 0)
    link.receive_now = lambda: [(key, HERE)]  # type: ignore[method-assign]
    for datagram, number, address, owner in GroundLinks([link], Clock(), Clock()).receive(stations):
        stations.hub.receive(datagram, number, address, 0, owner=owner)
        break
    stations.poll(0)
    assert [line.text for line in stations.take_texts()] == [KEY_REFUSED]


def test_notes_of_links_are_handed_on() -> None:
    clock, link = Clock(), FakeLink(0, 0)
    links = GroundLinks([link, FakeLink(1, 0)], clock, clock)
    link.notes = ["the device is gone"]
    assert links.take_notes() == ["the device is gone"]
    assert links.take_notes() == []
