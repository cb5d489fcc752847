"""Whether the vehicle stands: told from a reference that sinks on while the vehicle does not."""

from typing import NamedTuple

from autopilot.controller import VehicleState
from autopilot.reference import Reference

_BELOW_M = 0.15
_STILL_M_S = 0.15
_LEVEL_RAD_S = 0.5
_FOR_US = 400_000

STANDING_BELOW_M = 0.5
STANDING_SLOWER_M_S = 0.3


class Landing(NamedTuple):
    """What the detector remembers.

    Attributes:
        since_us: Since when all signs have said that the vehicle stands; None if they do not.
    """

    since_us: int | None = None


def watch(landing: Landing, now_us: int, state: VehicleState, sinks: bool) -> tuple[Landing, bool]:
    """Return what to remember, and whether the vehicle stands: its signs have lasted.

    Only the ground can hold a vehicle that `sinks`: that is told to, or whose rotors do not turn, and yet is still.
    """
    still = max(map(abs, state.velocity_enu_m_s)) < _STILL_M_S and max(map(abs, state.rate_flu_rad_s)) < _LEVEL_RAD_S
    if not (sinks and still):
        return Landing(), False
    since_us = now_us if landing.since_us is None else landing.since_us
    return Landing(since_us), now_us - since_us >= _FOR_US


def is_below(reference: Reference, state: VehicleState) -> bool:
    """Whether the reference is so far below the vehicle that it must sink."""
    return float(reference.motion[0, 2]) < state.position_enu_m[2] - _BELOW_M


def stands_at_first(state: VehicleState, home_z_m: float) -> bool:
    """Guess whether a vehicle that is seen for the first time stands: low and still."""
    still = max(map(abs, state.velocity_enu_m_s)) < STANDING_SLOWER_M_S
    return still and abs(state.position_enu_m[2] - home_z_m) < STANDING_BELOW_M
