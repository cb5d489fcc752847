"""Status texts of the commander's parts for ground stations, queued until they are sent."""

from typing import NamedTuple


class Said(NamedTuple):
    """A status text.

    Attributes:
        severity: MAV_SEVERITY.
        text: One line.
    """

    severity: int
    text: str


class StatusQueue:
    """Status texts in order."""

    def __init__(self) -> None:
        """Begin empty."""
        self._said: list[Said] = []

    def say(self, severity: int, text: str) -> None:
        """Add a line."""
        self._said.append(Said(severity, text))

    def take(self) -> list[Said]:
        """Return the lines, and empty the queue."""
        said, self._said = self._said, []
        return said
