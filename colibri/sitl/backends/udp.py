"""Plant and autopilot as processes that this one connects over UDP."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter, sleep

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.types import Address
from colibri.mavlink.hil.conductor import Gathering, StepMessage, packets
from colibri.mavlink.links.open import open_link
from colibri.mavlink.links.udp import UdpLink
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Codec
from colibri.plant.spec import PlantSpec
from colibri.sitl.backends.launcher import Launcher, LoggedChild
from colibri.sitl.backends.link_faults import QuickClock, SessionError, answers, parted

__tracebackhide__ = True  # a failed test shows its own lines, not these

SILENCE_S = 60.0  # wall-clock time after which a silent process counts as dead. Flights are independent of it.
_LOOK_EVERY_S = 0.1
_HERE = "udpin:127.0.0.1:0"


class UdpPlant:
    def __init__(self, launcher: Launcher, spec: PlantSpec, folder: Path) -> None:
        self._child = LoggedChild(launcher, replace(spec, link=_HERE), folder / "plant.said")
        self.process = self._child.number
        self._link: UdpLink | None = None
        self.clock = QuickClock()
        self._last = self._answer = b""

    def receive(self, datagram: bytes) -> None:
        if self._link is None:
            self._link = opened(self._url().replace("udpin", "udpout"))
        self._answer = datagram
        self._link.send(datagram)

    def frame(self) -> list[bytes]:
        assert self._link is not None, "it was called"
        datagrams = []
        while True:
            datagram, _ = received(self._link, self._child)
            if datagram == self._last:  # the answer was lost
                self._link.send(self._answer)
                continue
            datagrams.append(datagram)
            if parted(datagram)[1]:
                self._last = datagram
                return datagrams

    def listen(self, timeout_s: float) -> list[bytes]:
        assert self._link is not None, "it was called"
        self._link.wait(timeout_s)
        datagrams = [datagram for datagram, _ in self._link.receive_now()]
        if not datagrams:
            self._child.check()
        self._last = next((datagram for datagram in reversed(datagrams) if parted(datagram)[1]), self._last)
        return datagrams

    def close(self) -> None:
        self._child.kill()
        if self._link is not None:
            self._link.close()

    def _url(self) -> str:
        began_s = perf_counter()
        while perf_counter() < began_s + SILENCE_S:
            for line in self._child.log.read_text(encoding="utf-8").split("\n")[:-1]:
                if line.startswith('{"event": "listening"'):
                    url: str = json.loads(line)["url"]
                    return url
            self._child.check()
            sleep(0.005)
        raise SessionError(f"the plant was silent for {SILENCE_S:.0f} s")


class UdpAutopilot:
    def __init__(self, launcher: Launcher, spec: AutopilotSpec, folder: Path) -> None:
        self._launcher = launcher
        self._folder = folder
        self._spec = spec
        self._starts = 0
        self.start()

    def start(self) -> None:
        self._starts += 1
        self._link, self._stations = opened(_HERE), opened(_HERE)
        plant, stations = (link.url.replace("udpin", "udpout") for link in (self._link, self._stations))
        log = self._folder / f"autopilot-{self._starts}.said"
        self._child = LoggedChild(self._launcher, replace(self._spec, plant=plant, stepped=stations), log)
        self.process = self._child.number
        self._gathering = Gathering()
        self._time_us = 0

    def call(self) -> bytes:
        _meet(self._stations, self._child, lambda packet: packet == b"")
        source = (self._spec.system_id, AUTOPILOT_COMPONENT)
        codec = Codec(*source)
        return _meet(
            self._link, self._child, lambda packet: [each.source for each in codec.decode(packet)] == [source] * 2
        )

    def expect(self, step_message: StepMessage) -> None:
        self._time_us = step_message.time_us
        for packet in packets(step_message):
            self._stations.send(packet)

    def receive(self, datagram: bytes) -> None:
        self._link.send(datagram)

    def listen(self) -> list[bytes]:
        datagrams = [datagram for datagram, _ in self._link.receive_now()]
        if not datagrams:
            self._child.check()
        return datagrams

    def answer(self) -> bytes:
        while True:
            datagram, _ = received(self._link, self._child)
            if answers(datagram, self._time_us):
                return datagram

    def to_stations(self) -> StepMessage:
        while True:
            packet, _ = received(self._stations, self._child)
            step_message = self._gathering.take(packet)
            if step_message is not None:
                return step_message

    def close(self) -> None:
        self._child.kill()
        self._link.close()
        self._stations.close()

    def kill(self) -> None:
        self.close()


def opened(url: str) -> UdpLink:
    """Open a link that sleeps between polls, as flights share the cores."""
    link = open_link(url)
    link.spin_s = 0.0
    return link


def received(link: UdpLink, child: LoggedChild) -> tuple[bytes, Address]:
    began_s = perf_counter()
    while (datagram := link.receive(_LOOK_EVERY_S)) is None:
        child.check()
        if perf_counter() > began_s + SILENCE_S:
            raise SessionError(f"the {child.name} was silent for {SILENCE_S:.0f} s, but still runs")
    return datagram


def _meet(link: UdpLink, child: LoggedChild, expected: Callable[[bytes], bool]) -> bytes:
    """Bind a link to the first sender of what is expected, and return that."""
    while True:
        datagram, address = received(link, child)
        if expected(datagram):
            link.speak_with(address)
            return datagram
