"""Plant and autopilot as processes over UDP, either or both, this process in between."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter, sleep

from colibri.autopilot.spec import AutopilotSpec
from colibri.common.types import Address
from colibri.mavlink.hil.conductor import Gathering, StepMessage, packets
from colibri.mavlink.links.open import open_link
from colibri.mavlink.links.udp import UdpLink
from colibri.plant.spec import PlantSpec
from colibri.sitl.backends.launcher import Launcher, LoggedChild
from colibri.sitl.backends.link_clocks import QuickClock
from colibri.sitl.backends.lockstep import SessionError, answers, parted

SILENCE_S = 60.0
"""Wall-clock time after which a silent process is taken for dead. No flight depends on it."""
_LOOK_EVERY_S = 0.1
_HERE = "udpin:127.0.0.1:0"


class UdpPlant:
    """A plant in another process."""

    def __init__(self, launcher: Launcher, spec: PlantSpec, folder: Path) -> None:
        """Start it; `folder` takes its output."""
        self._child = LoggedChild(launcher, replace(spec, link=_HERE), folder / "plant.said")
        self._link: UdpLink | None = None
        self._clock = QuickClock()
        self._last = self._answer = b""

    @property
    def process(self) -> int:
        """The number of its process."""
        return self._child.number

    def receive(self, datagram: bytes) -> None:
        """Send a datagram of an autopilot that answers no frame: its call."""
        if self._link is None:
            self._link = opened(self._url().replace("udpin", "udpout"))
        self._link.send(datagram)

    def frame(self) -> list[bytes]:
        """Return what the plant sends up to its next frame, which comes last."""
        assert self._link is not None, "it was called"
        datagrams = []
        while True:
            datagram, _ = received(self._link, (self._child,), "plant")
            if datagram == self._last:  # the answer was lost
                if self._answer:
                    self._link.send(self._answer)
                continue
            datagrams.append(datagram)
            if parted(datagram)[1]:
                self._last, self._answer = datagram, b""
                return datagrams

    def take(self, answer: bytes) -> None:
        """Send the answer to that frame."""
        assert self._link is not None, "it was called"
        self._answer = answer
        self._link.send(answer)

    def listen(self, timeout_s: float) -> list[bytes]:
        """Return what it sends up to `timeout_s` from now, repeating the frame that waits for an answer."""
        assert self._link is not None, "it was called"
        self._link.wait(timeout_s)
        datagrams = [datagram for datagram, _ in self._link.receive_now()]
        if not datagrams:
            self._child.check()
        self._last = next((datagram for datagram in reversed(datagrams) if parted(datagram)[1]), self._last)
        return datagrams

    def clock_s(self) -> float:
        """Return the time that links are late by."""
        return self._clock.now_s()

    def close(self) -> None:
        """End it."""
        self._child.kill()
        if self._link is not None:
            self._link.close()

    def _url(self) -> str:
        """Return where it listens."""
        began_s = perf_counter()
        while perf_counter() < began_s + SILENCE_S:
            for line in self._child.log.read_text(encoding="utf-8").split("\n")[:-1]:
                if line.startswith('{"event": "listening"'):
                    url: str = json.loads(line)["url"]
                    return url
            self._child.check()
            sleep(0.005)
        raise SessionError(f"the plant said nothing for {SILENCE_S:.0f} s")


class UdpAutopilot:
    """An autopilot in another process."""

    def __init__(self, launcher: Launcher, spec: AutopilotSpec, folder: Path) -> None:
        """Start it; `folder` takes its output."""
        self._launcher = launcher
        self._folder = folder
        self._spec = spec
        self._starts = 0
        self.start()

    @property
    def process(self) -> int:
        """The number of its process."""
        return self._child.number

    def start(self) -> None:
        """Start it again."""
        self._starts += 1
        self._link, self._stations = opened(_HERE), opened(_HERE)
        plant, stations = (link.url.replace("udpin", "udpout") for link in (self._link, self._stations))
        log = self._folder / f"autopilot-{self._starts}.said"
        self._child = LoggedChild(self._launcher, replace(self._spec, plant=plant, stepped=stations), log)
        self._gathering = Gathering()
        self._time_us = 0

    def call(self) -> bytes:
        """Return how it calls a plant."""
        _, address = received(self._stations, (self._child,), "autopilot")
        self._stations.speak_with(address)
        call, address = received(self._link, (self._child,), "autopilot")
        self._link.speak_with(address)
        return call

    def receive_frame(self, frame: bytes, step_message: StepMessage) -> None:
        """Take in a frame of the plant, and what ground stations send at its time."""
        self.expect(step_message)
        self.receive(frame)

    def expect(self, step_message: StepMessage) -> None:
        """Take in what ground stations send at the time of the next frame."""
        self._time_us = step_message.time_us
        for packet in packets(step_message):
            self._stations.send(packet)

    def receive(self, datagram: bytes) -> None:
        """Give it a datagram of the plant's, sound or not."""
        self._link.send(datagram)

    def listen(self) -> list[bytes]:
        """Return what it has sent to the plant."""
        datagrams = [datagram for datagram, _ in self._link.receive_now()]
        if not datagrams:
            self._child.check()
        return datagrams

    def answer(self) -> bytes:
        """Return its answer to the frame; everything else is a call for a plant."""
        while True:
            datagram, _ = received(self._link, (self._child,), "autopilot")
            if answers(datagram, self._time_us):
                return datagram

    def to_stations(self) -> StepMessage:
        """Return what it sends to ground stations at that frame."""
        while True:
            packet, _ = received(self._stations, (self._child,), "autopilot")
            step_message = self._gathering.take(packet)
            if step_message is not None:
                return step_message

    def kill(self) -> None:
        """End it as a power cut does, and forget what is still on its way."""
        self.close()

    def close(self) -> None:
        """End it."""
        self._child.kill()
        self._link.close()
        self._stations.close()


def opened(url: str) -> UdpLink:
    """Open a link that is polled with pauses: flights share the cores."""
    link = open_link(url)
    link.spin_s = 0.0
    return link


def received(
    link: UdpLink, children: Sequence[LoggedChild], name: str, silence_s: float = SILENCE_S
) -> tuple[bytes, Address]:
    """Return what comes next.

    Raises:
        SessionError: The process has died, or is silent.
    """
    began_s = perf_counter()
    while (datagram := link.receive(_LOOK_EVERY_S)) is None:
        for child in children:
            child.check()
        if perf_counter() > began_s + silence_s:
            raise SessionError(f"the {name} has said nothing for {silence_s:.0f} s, and lives")
    return datagram
