"""Recent references, for the error of an estimate that arrives late."""

from bisect import bisect_right
from typing import NamedTuple

from colibri.common.types import Vector

_KEPT = 256


class PastReference(NamedTuple):
    """A reference with its time; `track_enu_m` is `None` on the way to the track."""

    at_us: int
    position_enu_m: Vector
    track_enu_m: Vector | None
    track_s: float


class ReferenceHistory:
    """References by time."""

    def __init__(self) -> None:
        self._past: list[PastReference] = []

    def add(self, reference: PastReference) -> None:
        if self._past and reference.at_us <= self._past[-1].at_us:
            return
        self._past.append(reference)
        if len(self._past) > 2 * _KEPT:
            del self._past[:_KEPT]

    def at(self, time_us: int) -> PastReference | None:
        """Interpolate the reference at a time; `None` outside the history."""
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
