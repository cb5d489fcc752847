"""Steps of an identification: small, short doublets of body rates, one axis after another."""

from typing import NamedTuple

from colibri.common.types import Vector

ROUNDS = 3
PAUSE_S = 1.2
"""Rest between two doublets."""


class Doublet(NamedTuple):
    """A rate added about one axis (0..2), then the opposite rate, for `half_s` each."""

    axis: int
    rate_rad_s: float
    half_s: float


DOUBLETS = (Doublet(0, 0.4, 0.2), Doublet(1, 0.4, 0.2), Doublet(2, 0.4, 0.4))
_NOTHING: Vector = (0.0, 0.0, 0.0)


def duration_s() -> float:
    return ROUNDS * sum(PAUSE_S + 2.0 * doublet.half_s for doublet in DOUBLETS)


def step_at(time_s: float) -> Vector:
    left_s = time_s % (duration_s() / ROUNDS)
    for doublet in DOUBLETS:
        left_s -= PAUSE_S
        if left_s < 0.0:
            return _NOTHING
        if left_s < 2.0 * doublet.half_s:
            rate = doublet.rate_rad_s if left_s < doublet.half_s else -doublet.rate_rad_s
            p, q, r = (rate if axis == doublet.axis else 0.0 for axis in range(3))
            return (p, q, r)
        left_s -= 2.0 * doublet.half_s
    return _NOTHING
