"""STATUSTEXT: a line for whoever watches, in chunks where it is long.

Specification: mavlink.io, message STATUSTEXT (253): text beyond 50 bytes goes on in further messages with the same id
that is not zero, counted by chunk_seq; a chunk that is not full ends it.
"""

from collections import deque
from typing import NamedTuple

from colibri.mavlink.node.service import Send, to_all
from colibri.mavlink.wire.dialect import mav

CHUNK_BYTES = 50
MAX_TEXT_BYTES = 254
_REMEMBERED = 20

EMERGENCY: int = mav.MAV_SEVERITY_EMERGENCY
ERROR: int = mav.MAV_SEVERITY_ERROR
CRITICAL: int = mav.MAV_SEVERITY_CRITICAL
WARNING: int = mav.MAV_SEVERITY_WARNING
NOTICE: int = mav.MAV_SEVERITY_NOTICE
INFO: int = mav.MAV_SEVERITY_INFO


_WORDS = ("emergency", "alert", "critical", "error", "warning")
"""Of severities from 0 on; those behind them are no cause for alarm."""


class Line(NamedTuple):
    """A status text and its MAV_SEVERITY."""

    severity: int
    text: str

    def __str__(self) -> str:
        """Return the text, of a warning or worse with a word that says so."""
        return self.text if self.severity > WARNING else f"{_WORDS[self.severity]}: {self.text}"


class StatusText:
    """Numbers the texts that need more than one message, and remembers the last until they are taken."""

    def __init__(self) -> None:
        """Begin with id 1: 0 means a text of one chunk."""
        self._next = 1
        self._said: deque[Line] = deque(maxlen=_REMEMBERED)

    def say(self, severity: int, text: str) -> list[Send]:
        """Return the STATUSTEXT messages of `text`, to all channels."""
        self._said.append(Line(severity, text))
        data = text.encode()[:MAX_TEXT_BYTES]
        if len(data) <= CHUNK_BYTES:
            return [to_all("STATUSTEXT", severity, data, 0, 0)]
        number, self._next = self._next, self._next % 0xFFFF + 1
        starts = range(0, len(data) + 1, CHUNK_BYTES)  # where the last chunk is full, an empty one ends the text
        return [
            to_all("STATUSTEXT", severity, data[start : start + CHUNK_BYTES], number, chunk)
            for chunk, start in enumerate(starts)
        ]

    def take(self) -> list[Line]:
        """Return all texts since the last time."""
        if not self._said:
            return []
        said = list(self._said)
        self._said.clear()
        return said
