"""A relay that loses, duplicates and reorders datagrams, seeded."""

import random

from tools.harness.relay import Relay

LOSS = 0.2
DUPLICATION = 0.1
REORDERING = 0.1


class BadLink(Relay):
    """A relay as a bad radio link would be, both ways.

    Attributes:
        counts: What was done to the datagrams.
    """

    def __init__(self, plant_url: str, seed: int) -> None:
        """Relay to the plant at `plant_url`, by chance of `seed`."""
        super().__init__(plant_url)
        self._chance = random.Random(seed)
        self._held: dict[str, bytes] = {}
        self.counts = {"passed": 0, "lost": 0, "duplicated": 0, "reordered": 0}

    def pass_on(self, to: str, datagram: bytes) -> None:
        """Lose it, hold it back behind the next, or send it on once or twice."""
        fate = self._chance.random()
        if fate < LOSS:
            self.counts["lost"] += 1
        elif fate < LOSS + REORDERING and to not in self._held:
            self.counts["reordered"] += 1
            self._held[to] = datagram
        else:
            self.counts["passed"] += 1
            self.deliver(to, datagram)
            if fate > 1.0 - DUPLICATION:
                self.counts["duplicated"] += 1
                self.deliver(to, datagram)
            if to in self._held:
                self.deliver(to, self._held.pop(to))
