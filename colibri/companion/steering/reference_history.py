"""The references of the last moments, to tell an estimate that comes late how far it was from where it had to be."""

from bisect import bisect_right
from typing import NamedTuple

from colibri.common.types import Vector

_KEPT = 256


class PastReference(NamedTuple):
    """A reference.

    Attributes:
        at_us: When it is to be reached, by the own clock.
        position_enu_m: Where.
        track_enu_m: Where the track is then; None on the way to it.
        track_s: Time along the track.
    """

    at_us: int
    position_enu_m: Vector
    track_enu_m: Vector | None
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
        track_s = before.track_s + part * (then.track_s - before.track_s)
        place = _between(before.position_enu_m, then.position_enu_m, part)
        if before.track_enu_m is None or then.track_enu_m is None:
            return PastReference(time_us, place, None, track_s)
        return PastReference(time_us, place, _between(before.track_enu_m, then.track_enu_m, part), track_s)


def _between(first: Vector, second: Vector, part: float) -> Vector:
    x, y, z = (a + part * (b - a) for a, b in zip(first, second, strict=True))
    return (x, y, z)
