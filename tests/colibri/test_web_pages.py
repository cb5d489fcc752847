"""A web page posts MAVLink to each kind of TCP port: it is disconnected, obeyed in nothing, and that is said."""

import socket
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from types import SimpleNamespace
from typing import Any, cast

import pytest

from colibri.autopilot.process.ground_links import GroundLinks
from colibri.common.process.status import Silent
from colibri.companion import process as companion_process
from colibri.mavlink.links.open import open_ground_link
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.plant.process.px4_server import Simulator
from colibri.plant.spec import PlantSpec
from colibri.view.live import LiveVehicle
from tools.harness.processes import wait_for

HERE = "tcpin:127.0.0.1:0"
BODY = Codec(1, 1).encode("HEARTBEAT", 6, 12, 0, 0, 4, 3) + Codec(255, 190).encode(
    "COMMAND_LONG", 1, 1, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *[0.0] * 6
)
POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: %d\r\n\r\n" % len(BODY) + BODY


class Said(Silent):
    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def say(self, event: str, text: str, **facts: Any) -> None:
        del event, facts
        self.lines.append(text)


class Served:
    """What has a port: serve it once, what it has said, and whether anything was taken from the page."""

    def __init__(
        self, url: str, turn: Callable[[], object], said: Callable[[], list[str]], taken: list[object]
    ) -> None:
        self.url, self.turn, self.said, self.taken = url, turn, said, taken


@contextmanager
def view() -> Iterator[Served]:
    with closing(LiveVehicle(HERE)) as live:
        autopilots: list[object] = []

        def turn() -> None:
            if live.autopilot is not None:
                autopilots.append(live.autopilot)

        yield Served(live.url, turn, lambda: list(live.at(0.0).texts), autopilots)


@contextmanager
def companion() -> Iterator[Served]:
    with closing(open_ground_link(HERE)) as link:
        status, taken = Said(), list[object]()
        peer = SimpleNamespace(report=SimpleNamespace(take_new_texts=list))
        flies = SimpleNamespace(ended=None, said=[], waits_for=[], peer=peer, poll=lambda _: [])
        flies.receive = lambda datagram, _: taken.append(datagram)
        wire = companion_process._Wire(link)  # noqa: SLF001
        log = SimpleNamespace(write=lambda each: setattr(each, "ended", True))

        def turn() -> None:
            flies.ended = None
            companion_process.serve(cast(Any, flies), wire, status, cast(Any, False), cast(Any, log))

        yield Served(link.url, turn, lambda: status.lines, taken)


@contextmanager
def px4_simulator() -> Iterator[Served]:
    with closing(open_ground_link(HERE)) as link:
        status = Said()
        simulator = Simulator(PlantSpec(vehicle="jmavsim"), link, status, cast(Any, False))
        yield Served(
            link.url,
            lambda: simulator._exchange(0.01),  # noqa: SLF001
            lambda: status.lines,
            cast(Any, simulator._end.received),  # noqa: SLF001
        )


@contextmanager
def station() -> Iterator[Served]:
    with closing(open_ground_link(HERE)) as link:
        links, taken, said = GroundLinks([link], lambda: 0.0, lambda: 0.0), list[object](), list[str]()
        hub = SimpleNamespace(open=lambda *_: 0, close=lambda *_: None)
        stations = cast(Any, SimpleNamespace(hub=hub, streams=SimpleNamespace(use=lambda *_: None)))

        def turn() -> None:
            taken.extend(links.receive(stations))
            said.extend(links.take_notes())

        yield Served(link.url, turn, lambda: said, taken)


@pytest.mark.parametrize("port", [station, view, companion, px4_simulator], ids=lambda each: each.__name__)
def test_a_web_page_is_disconnected_and_reported(port: Callable[[], Any]) -> None:
    with port() as served, socket.socket() as page:
        page.connect(("127.0.0.1", int(served.url.rpartition(":")[2])))
        page.sendall(POST)

        def reported() -> bool:
            served.turn()
            return any("speaks HTTP, as a web page does" in line for line in served.said())

        wait_for(reported, "the report")
        assert not served.taken
