"""The vehicle's own services at the other end of a link that loses, duplicates and reorders datagrams."""

from collections.abc import Callable, Sequence
from random import Random
from typing import Any

from colibri.mavlink.client.client import Client
from colibri.mavlink.node.service import Peer, PolledService, Send, Service
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Codec, mav

TARGET = (1, AUTOPILOT_COMPONENT)
STEP_US = 4_000
MINUTE_US = 60_000_000


class Vehicle:
    """Microservices of one component; `heartbeat` says whether it sends one a second."""

    def __init__(self, *services: Service, heartbeat: bool = False) -> None:
        self._services = services
        self._codec = Codec(*TARGET)
        self._heartbeat = heartbeat

    def receive(self, frame: bytes, peer: Peer, now_us: int) -> list[tuple[int | None, bytes]]:
        """Return the answers to a frame, each with its channel, None for all."""
        return [
            self._encoded(send)
            for message in self._codec.decode(frame)
            for service in self._services
            if message.name in service.handles
            for send in service.receive(message, peer, now_us)
        ]

    def poll(self, now_us: int) -> list[tuple[int | None, bytes]]:
        sends = [
            self._encoded(send)
            for service in self._services
            if isinstance(service, PolledService)
            for send in service.poll(now_us)
        ]
        if self._heartbeat and now_us % 1_000_000 < STEP_US:
            beat = (mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4, 0, 0, mav.MAV_STATE_ACTIVE, 3)
            sends.append((None, self._codec.encode("HEARTBEAT", *beat)))
        return sends

    def _encoded(self, send: Send) -> tuple[int | None, bytes]:
        return send.channel, self._codec.encode(send.name, *send.fields)


class Link:
    """Carries datagrams between clients and a vehicle; `datagrams` counts those that were sent."""

    def __init__(
        self, vehicle: Vehicle, clients: Sequence[Client], seed: int, *, loss: float = 0.0, unruly: float = 0.0
    ) -> None:
        self._vehicle, self._clients = vehicle, clients
        self._chance = Random(seed)
        self._loss, self._unruly = loss, unruly
        self._up: list[tuple[int, int, bytes]] = []
        self._down: list[tuple[int, int, bytes]] = []
        self.now_us = 0
        self.datagrams = 0

    def run(self, until: Callable[[], Any], within_us: int = MINUTE_US) -> bool:
        end_us = self.now_us + within_us
        while self.now_us < end_us and not until():
            self.step()
        return bool(until())

    def step(self) -> None:
        self.now_us += STEP_US
        self._send_down(self._vehicle.poll(self.now_us))
        for number, frame in self._arrived(self._up):
            peer = Peer(number, *self._clients[number].source)
            self._send_down(self._vehicle.receive(frame, peer, self.now_us))
        for number, frame in self._arrived(self._down):
            self._clients[number].receive(frame, self.now_us)
        for number, client in enumerate(self._clients):
            for frame in client.poll(self.now_us):
                self._put(self._up, number, frame)

    def _send_down(self, sends: list[tuple[int | None, bytes]]) -> None:
        for channel, frame in sends:
            for number in range(len(self._clients)):
                if channel in (None, number):
                    self._put(self._down, number, frame)

    def _put(self, way: list[tuple[int, int, bytes]], number: int, frame: bytes) -> None:
        self.datagrams += 1
        if self._chance.random() < self._loss:
            return
        steps = [1]
        if self._chance.random() < self._unruly:
            steps = [self._chance.randrange(1, 20) for _ in range(self._chance.choice((1, 2)))]
        way += [(self.now_us + STEP_US * count, number, frame) for count in steps]

    def _arrived(self, way: list[tuple[int, int, bytes]]) -> list[tuple[int, bytes]]:
        due = sorted((each for each in way if each[0] <= self.now_us), key=lambda each: each[0])
        way[:] = [each for each in way if each[0] > self.now_us]
        return [(number, frame) for _, number, frame in due]
