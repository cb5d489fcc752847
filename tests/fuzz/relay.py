"""A relay that hides each good datagram in a burst of bad ones, from the address that the good ones come from."""

import random
import socket
from select import select
from threading import Event, Thread
from types import TracebackType
from typing import Self

from tests.fuzz.datagrams import AUTOPILOT, PLANT, Fuzzer


class FuzzingRelay:
    """Stands between an autopilot, which calls `url`, and a plant.

    Attributes:
        url: What the autopilot is to call.
        sent: Bad datagrams sent so far, by whom they were for and of which kind.
    """

    def __init__(self, plant_url: str, *, burst: int, quota: int, seed: int) -> None:
        """Relay to the plant; send bursts of `burst`, half random and half hostile, up to `quota` of each each way."""
        _, host, port = plant_url.split(":")
        self._plant = (host, int(port))
        self._sockets = {name: self._socket() for name in ("autopilot", "plant")}
        chance = random.Random(seed)
        self._fuzzers = {"plant": Fuzzer(chance, AUTOPILOT, PLANT), "autopilot": Fuzzer(chance, PLANT, AUTOPILOT)}
        self._burst = burst
        self._quota = quota
        self._chance = chance
        self._autopilot: tuple[str, int] | None = None
        self._begun = False
        self._ended = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self.sent = {(to, kind): 0 for to in ("plant", "autopilot") for kind in ("random", "hostile")}
        self.url = f"udpout:127.0.0.1:{self._sockets['autopilot'].getsockname()[1]}"

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
        for sock in self._sockets.values():
            sock.close()

    def _run(self) -> None:
        near, far = self._sockets["autopilot"], self._sockets["plant"]
        while not self._ended.is_set():
            for sock in select([near, far], [], [], 0.05)[0]:
                datagram, sender = sock.recvfrom(4096)
                if sock is near:
                    self._autopilot = sender
                    # What the genuine autopilot asks for before a flight is not an attack: begin with its first answer.
                    self._begun = self._begun or datagram[7:10] == b"\x5d\x00\x00"
                    self._pass("plant", datagram)
                else:
                    self._pass("autopilot", datagram)

    def _pass(self, to: str, good: bytes) -> None:
        datagrams = self._bad(to) if self._begun else []
        datagrams.insert(self._chance.randint(0, len(datagrams)), good)
        for datagram in datagrams:
            if to == "plant":
                self._sockets["plant"].sendto(datagram, self._plant)
            elif self._autopilot:
                self._sockets["autopilot"].sendto(datagram, self._autopilot)

    def _bad(self, to: str) -> list[bytes]:
        fuzzer, datagrams = self._fuzzers[to], []
        for number in range(self._burst):
            kind = "hostile" if number % 2 else "random"
            if self.sent[to, kind] < self._quota:
                self.sent[to, kind] += 1
                datagrams.append(fuzzer.hostile() if kind == "hostile" else fuzzer.random())
        return datagrams

    @staticmethod
    def _socket() -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.bind(("127.0.0.1", 0))
        return sock
