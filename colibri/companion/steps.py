"""Steps of an identification: small, short doublets of body rates, one axis after another, as they are flown."""

from typing import NamedTuple

from colibri.common.types import Vector
from colibri.mavlink.client.states import TimedState

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


class StepFlight:
    """Adds the steps to a law's body rates; rows of `commanded` and `measured` are time, s, p, q, r, rad/s."""

    def __init__(self) -> None:
        self.commanded: list[tuple[float, float, float, float]] = []
        self.measured: list[tuple[float, float, float, float]] = []
        self._began_us: int | None = None

    def begin(self, at_us: int) -> None:
        self._began_us = at_us

    def is_over(self, now_us: int) -> bool:
        return self._began_us is not None and (now_us - self._began_us) * 1e-6 >= duration_s()

    def rates(self, rate_flu_rad_s: Vector, now_us: int, arrives_us: int) -> Vector:
        """Return the rates to command now, which arrive at the vehicle at `arrives_us`."""
        if self._began_us is None:
            return rate_flu_rad_s
        step = step_at((now_us - self._began_us) * 1e-6)
        p, q, r = (a + b for a, b in zip(rate_flu_rad_s, step, strict=True))
        self.commanded.append((arrives_us * 1e-6, p, q, r))
        return p, q, r

    def add(self, at_us: int, state: TimedState) -> None:
        if self._began_us is not None:
            self.measured.append((at_us * 1e-6, *state.rate_flu_rad_s))
