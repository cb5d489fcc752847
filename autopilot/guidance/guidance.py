"""Guidance: the references of one control sample, as the control law takes them."""

from typing import NamedTuple

from colibri.autopilot.control.interface import AttitudeDemand, Horizon, Pace


class Guidance(NamedTuple):
    """References for the control law; neither horizon nor attitude while the rotors stand or idle.

    Attributes:
        horizon: References of position and yaw.
        attitude: References of attitude and thrust.
        begins: Whether the rotors leave idle now: the control law is reset.
        pace: How time passes along the horizon.
    """

    horizon: Horizon | None = None
    attitude: AttitudeDemand | None = None
    begins: bool = False
    pace: Pace = Pace.CLOCK


RESTS = Guidance()
