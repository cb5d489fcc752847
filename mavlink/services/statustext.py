"""STATUSTEXT (253): a line for users, in chunks of 50 bytes; one that is not full ends it."""

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


_WORDS = ("emergency", "alert", "critical", "error", "warning")  # of severities from 0


class Line(NamedTuple):
    """A status text and its MAV_SEVERITY, shown as a prefix from warnings on."""

    severity: int
    text: str

    def __str__(self) -> str:
        return self.text if self.severity > WARNING else f"{_WORDS[self.severity]}: {self.text}"


class StatusText:
    """Numbers texts of several messages, and keeps the latest for `take`."""

    def __init__(self) -> None:
        self._next = 1
        self._said: deque[Line] = deque(maxlen=_REMEMBERED)

    def say(self, severity: int, text: str) -> list[Send]:
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
        said = list(self._said)
        self._said.clear()
        return said
