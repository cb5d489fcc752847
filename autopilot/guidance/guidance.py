"""References of one control sample."""

from typing import NamedTuple

from colibri.autopilot.control.interface import AttitudeDemand, Horizon, Pace


class Guidance(NamedTuple):
    """References for the control law, reset if it `begins`; empty on the ground."""

    horizon: Horizon | None = None
    attitude: AttitudeDemand | None = None
    begins: bool = False
    pace: Pace = Pace.CLOCK


RESTS = Guidance()
