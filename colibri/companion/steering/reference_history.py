"""The references of the last moments, to tell an estimate that comes late how far it was from where it had to be."""

from bisect import bisect_right
from typing import NamedTuple

from colibri.common.types import Vector

_KEPT = 256


class PastReference(NamedTuple):
    """A reference: when it is to be reached, by the own clock, where, and whether it is of the track."""

    at_us: int
    position_enu_m: Vector
    on_track: bool
    track_s: float


class ReferenceHistory:
    """References by the time at which they are to be reached."""

    def __init__(self) -> None:
        """Begin without any."""
        self._past: list[PastReference] = []

    def add(self, reference: PastReference) -> None:
        """Add the newest; one of an earlier time than the last is dropped."""
        if self._past and reference.at_us <= self._past[-1].at_us:
            return
        self._past.append(reference)
        if len(self._past) > 2 * _KEPT:
            del self._past[:_KEPT]

    def at(self, time_us: int) -> PastReference | None:
        """Return the reference of a time, between two linearly; None of one that is not between two."""
        after = bisect_right(self._past, time_us, key=lambda past: past.at_us)
        if after == 0 or after == len(self._past):
            return None
        before, then = self._past[after - 1], self._past[after]
        part = (time_us - before.at_us) / (then.at_us - before.at_us)
        x, y, z = (a + part * (b - a) for a, b in zip(before.position_enu_m, then.position_enu_m, strict=True))
        track_s = before.track_s + part * (then.track_s - before.track_s)
        return PastReference(time_us, (x, y, z), before.on_track and then.on_track, track_s)
