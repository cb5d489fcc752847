"""Summary of the flights of a test run: number, speed, and one hash that two runs can be compared by."""

from collections.abc import Mapping
from hashlib import sha256
from typing import Any

FLOWN = "sitl_flown"
"""The attribute of a report with the flights of its test."""


class Summary:
    """Adds up reports, whichever process they come from, in whatever order.

    Attributes:
        flights: How many were flown.
    """

    def __init__(self, began_s: float) -> None:
        """Begin at a time of the wall clock."""
        self._began_s = began_s
        self.flights = 0
        self._simulated_s = 0.0
        self._outcomes: dict[str, tuple[str, str]] = {}

    def add(self, test: str, outcome: str, flown: Mapping[str, Any] | None) -> None:
        """Take in a report of a test that has flown something, or nothing."""
        if flown is None:
            return
        self.flights += flown["flights"]
        self._simulated_s += flown["simulated_s"]
        self._outcomes[test] = (outcome, " ".join(flown["sha256"]))

    def lines(self) -> list[str]:
        """Return a line for each test: its name, outcome, and the hash of each of its flights; sorted."""
        return [f"{test} {outcome} {hashes}" for test, (outcome, hashes) in sorted(self._outcomes.items())]

    def verdict(self) -> str:
        """Return a hash over `lines`."""
        return sha256("\n".join(self.lines()).encode()).hexdigest()[:16]

    def line(self, now_s: float) -> str:
        """Return the sum in one line."""
        wall_s = now_s - self._began_s
        rate = self._simulated_s / wall_s
        flown = f"{self.flights} flights, {self._simulated_s:.1f} s simulated in {wall_s:.1f} s of wall-clock time"
        return f"sitl: {flown}, {rate:.1f} sim-s per wall-s, verdict {self.verdict()}"
