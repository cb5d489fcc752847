"""The lines for ground stations that the parts of the commander say, until somebody sends them."""

from typing import NamedTuple


class Said(NamedTuple):
    """A line for ground stations.

    Attributes:
        severity: MAV_SEVERITY.
        text: The line.
    """

    severity: int
    text: str


class StatusQueue:
    """Status texts in the order in which they were said."""

    def __init__(self) -> None:
        """Begin empty."""
        self._said: list[Said] = []

    def say(self, severity: int, text: str) -> None:
        """Add a line."""
        self._said.append(Said(severity, text))

    def take(self) -> list[Said]:
        """Return the lines, and forget them."""
        said, self._said = self._said, []
        return said
