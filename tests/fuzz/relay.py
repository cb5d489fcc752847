"""A relay that hides each good datagram in a burst of bad ones, from the address that the good ones come from."""

import random

from tests.fuzz.datagrams import ACTUATORS, AUTOPILOT, PLANT, Fuzzer
from tests.relay import Relay


class FuzzingRelay(Relay):
    """A relay with an attacker in it.

    Attributes:
        sent: Bad datagrams sent so far, by whom they were for and of which kind.
    """

    def __init__(self, plant_url: str, *, burst: int, quota: int, seed: int) -> None:
        """Relay to the plant; send bursts of `burst`, half random and half hostile, up to `quota` of each each way."""
        super().__init__(plant_url)
        self._chance = random.Random(seed)
        self._fuzzers = {
            "plant": Fuzzer(self._chance, AUTOPILOT, PLANT),
            "autopilot": Fuzzer(self._chance, PLANT, AUTOPILOT),
        }
        self._burst = burst
        self._quota = quota
        self._begun = False
        self.sent = {(to, kind): 0 for to in ("plant", "autopilot") for kind in ("random", "hostile")}

    def pass_on(self, to: str, datagram: bytes) -> None:
        """Send it on somewhere in a burst.

        What the genuine autopilot asks for before a flight is not an attack, so bursts begin with its first answer.
        """
        self._begun = self._begun or int.from_bytes(datagram[7:10], "little") == ACTUATORS
        datagrams = self._bad(to) if self._begun else []
        datagrams.insert(self._chance.randint(0, len(datagrams)), datagram)
        for each in datagrams:
            self.deliver(to, each)

    def _bad(self, to: str) -> list[bytes]:
        fuzzer, datagrams = self._fuzzers[to], []
        for number in range(self._burst):
            kind = "hostile" if number % 2 else "random"
            if self.sent[to, kind] < self._quota:
                self.sent[to, kind] += 1
                datagrams.append(fuzzer.hostile() if kind == "hostile" else fuzzer.random())
        return datagrams
