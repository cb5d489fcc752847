"""The steps of an identification as they are flown, and the body rates that follow."""

from colibri.common.types import Vector
from colibri.companion.identification.steps import duration_s, step_at
from colibri.mavlink.client.states import TimedState


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
