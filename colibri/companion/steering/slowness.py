"""Slow a law down for a vehicle whose body rates follow late: it would take model errors for motion, and swing."""

from typing import Any

from colibri.autopilot.control.profile import Profile
from colibri.companion.stacks.stack import Response

_AS_TUNED_S = 0.06
"""Largest delay, dead time and lag together, of a law as tuned."""
_MOST = 1.6
_WEIGHTS = {"position": -2.0, "velocity": 4.0, "rate": 6.0, "first_correction": 6.0, "next_correction": 6.0}
"""Power of the slowness in each weight: less demand on position, more cost of each change."""


def delay_s(response: Response) -> float:
    """Return the delay of roll and pitch rates, dead time and lag together, s.

    For second order this is the acceleration's lag: the inverse of the response undoes the rate loop.
    """
    pairs = zip(response.time_constant_s[:2], response.acceleration_lag_s[:2], strict=True)
    return response.latency_s + max(behind_s or lag_s for lag_s, behind_s in pairs)


def slowness(response: Response) -> float:
    """Return the factor of slowing; 1 for a vehicle that is quick enough."""
    return min(max(delay_s(response) / _AS_TUNED_S, 1.0), _MOST)


def lateness_s(response: Response) -> float:
    """Return the delay beyond the tuned one, s."""
    return max(delay_s(response) - _AS_TUNED_S, 0.0)


def slowed(profile: Profile, response: Response) -> Profile:
    """Slow the law down for a response; laws with other weights are unchanged."""
    times = slowness(response)
    weights: Any = profile.table(profile.controller).get("weights")
    if times == 1.0 or not isinstance(weights, dict) or not _WEIGHTS.keys() <= weights.keys():
        return profile
    for name, power in _WEIGHTS.items():
        profile = profile.replace(f"controllers.{profile.controller}.weights.{name}", weights[name] * times**power)
    return profile
