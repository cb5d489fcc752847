"""Landing detection: still while the reference sinks."""

from typing import NamedTuple

from colibri.autopilot.control.interface import VehicleState

_BELOW_M = 0.15
_STILL_M_S = 0.15
_LEVEL_RAD_S = 0.5
_FOR_US = 400_000
_DRIFTING_FOR_US = 600_000
CARRIED = 0.5
"""Thrust relative to weight below which a vehicle of unknown velocity falls or stands."""

_CLEAR_M = 0.3

STANDING_BELOW_M = 0.5
STANDING_SLOWER_M_S = 0.3


class Landing(NamedTuple):
    """Start of the stillness, and the climb rate then."""

    since_us: int | None = None
    climb_m_s: float = 0.0


_MOVES = Landing()


def watch(
    landing: Landing, now_us: int, state: VehicleState, sinks: bool, *, drifts: bool = False
) -> tuple[Landing, bool]:
    """Return the state, and whether the vehicle stands: still for long while it `sinks`.

    If the velocity estimate `drifts`, as without GPS, only its changes count: at half thrust the vehicle would
    accelerate, so a constant climb rate means that the ground holds it.
    """
    if not sinks:
        return _MOVES, False
    climb_m_s = state.velocity_enu_m_s[2]
    if drifts:
        still, for_us = abs(climb_m_s - landing.climb_m_s) < _STILL_M_S, _DRIFTING_FOR_US
    else:
        still, for_us = max(map(abs, state.velocity_enu_m_s)) < _STILL_M_S, _FOR_US
    if max(map(abs, state.rate_flu_rad_s)) >= _LEVEL_RAD_S:
        return _MOVES, False
    if landing.since_us is None or not still:
        return (Landing(now_us, climb_m_s) if still or drifts else _MOVES), False
    return landing, now_us - landing.since_us >= for_us


def is_below(height_m: float, state: VehicleState) -> bool:
    return height_m < state.position_enu_m[2] - _BELOW_M


def stands_at_first(state: VehicleState, home_z_m: float) -> bool:
    """Guess from the first state: low and still."""
    still = max(map(abs, state.velocity_enu_m_s)) < STANDING_SLOWER_M_S
    return still and abs(state.position_enu_m[2] - home_z_m) < STANDING_BELOW_M


def is_clear(landing: Landing, state: VehicleState, ground_m: float) -> bool:
    """Whether a vehicle in flight is well above or below its last standing height."""
    return landing.since_us is None and abs(state.position_enu_m[2] - ground_m) > _CLEAR_M
