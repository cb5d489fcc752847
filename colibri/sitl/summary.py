"""The summary of a test run's flights."""

from collections.abc import Mapping
from hashlib import sha256
from typing import Any

FLOWN = "sitl_flown"
"""Attribute of a report that holds the flights of its test."""


class Summary:
    """Adds up the reports of all processes in any order."""

    def __init__(self, began_s: float) -> None:
        self._began_s = began_s
        self.flights = 0
        self._simulated_s = 0.0
        self._outcomes: dict[str, tuple[str, str]] = {}

    def add(self, test: str, outcome: str, flown: Mapping[str, Any] | None) -> None:
        if flown is None:
            return
        self.flights += flown["flights"]
        self._simulated_s += flown["simulated_s"]
        self._outcomes[test] = (outcome, " ".join(flown["sha256"]))

    def lines(self) -> list[str]:
        """Return a sorted line per test: name, outcome, hashes."""
        return [f"{test} {outcome} {hashes}" for test, (outcome, hashes) in sorted(self._outcomes.items())]

    def verdict(self) -> str:
        return sha256("\n".join(self.lines()).encode()).hexdigest()[:16]

    def line(self, now_s: float) -> str:
        wall_s = now_s - self._began_s
        rate = self._simulated_s / wall_s
        flown = f"{self.flights} flights, {self._simulated_s:.1f} s simulated in {wall_s:.1f} s of wall-clock time"
        return f"sitl: {flown}, {rate:.1f} sim-s per wall-s, verdict {self.verdict()}"
