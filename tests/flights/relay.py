"""A UDP relay between autopilot and plant that loses, duplicates and reorders datagrams, seeded."""

import random
import socket
from select import select
from threading import Event, Thread
from types import TracebackType
from typing import Self

LOSS = 0.2
DUPLICATION = 0.1
REORDERING = 0.1


class Relay:
    """Stands between the autopilot, which calls `url`, and the plant at `plant`.

    Attributes:
        url: What the autopilot is to call.
        counts: What was done to the datagrams.
    """

    def __init__(self, plant_url: str, seed: int) -> None:
        """Relay to the plant at `plant_url`, by chance of `seed`."""
        _, host, port = plant_url.split(":")
        self._plant = (host, int(port))
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._near.bind(("127.0.0.1", 0))
        self._far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._far.bind(("127.0.0.1", 0))
        self._autopilot: tuple[str, int] | None = None
        self._chance = random.Random(seed)
        self._held: dict[str, bytes] = {}
        self._ended = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self.counts = {"passed": 0, "lost": 0, "duplicated": 0, "reordered": 0}
        self.url = f"udpout:127.0.0.1:{self._near.getsockname()[1]}"

    def __enter__(self) -> Self:
        """Start relaying."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop relaying."""
        self._ended.set()
        self._thread.join()
        self._near.close()
        self._far.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            for sock in select([self._near, self._far], [], [], 0.05)[0]:
                datagram, sender = sock.recvfrom(4096)
                if sock is self._near:
                    self._autopilot = sender
                    self._pass("plant", datagram)
                else:
                    self._pass("autopilot", datagram)

    def _pass(self, to: str, datagram: bytes) -> None:
        fate = self._chance.random()
        if fate < LOSS:
            self.counts["lost"] += 1
        elif fate < LOSS + REORDERING and to not in self._held:
            self.counts["reordered"] += 1
            self._held[to] = datagram
        else:
            self._deliver(to, datagram)
            if fate > 1.0 - DUPLICATION:
                self.counts["duplicated"] += 1
                self._deliver(to, datagram)
            if to in self._held:
                self._deliver(to, self._held.pop(to))

    def _deliver(self, to: str, datagram: bytes) -> None:
        self.counts["passed"] += 1
        if to == "plant":
            self._far.sendto(datagram, self._plant)
        elif self._autopilot:
            self._near.sendto(datagram, self._autopilot)
