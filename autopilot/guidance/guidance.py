"""References of one control sample for the control law."""

from typing import NamedTuple

from colibri.autopilot.control.interface import AttitudeDemand, Horizon, Pace


class Guidance(NamedTuple):
    """References for the control law; empty while the rotors stand or idle.

    Attributes:
        begins: Whether the rotors leave idle now: the control law is reset.
        pace: Progress of time along the horizon.
    """

    horizon: Horizon | None = None
    attitude: AttitudeDemand | None = None
    begins: bool = False
    pace: Pace = Pace.CLOCK


RESTS = Guidance()
