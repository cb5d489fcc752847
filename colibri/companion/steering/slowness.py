"""How much slower a law must be for a vehicle whose body rates follow late, and the law made so.

What a model misses of a vehicle is answered by a loop no quicker than the vehicle's delay allows. A law tuned for
rotors of its own is quicker than some stacks: it would take what the model misses of those for motion, and swing.
"""

from typing import Any

from colibri.autopilot.control.profile import Profile
from colibri.companion.stacks.stack import Response

_AS_TUNED_S = 0.06
"""Up to this delay, dead time and lag together, a law flies as it is tuned."""
_MOST = 1.6
_WEIGHTS = {"position": -2.0, "velocity": 4.0, "rate": 6.0, "first_correction": 6.0, "next_correction": 6.0}
"""With which power of the slowness each weight goes: less is asked of the place, and each change costs more."""


def delay_s(response: Response) -> float:
    """Return how late roll and pitch rates follow, dead time and lag together, s.

    Of a response of second order only the dead time and the lag of the acceleration count: a law knows that lag, and
    what the rate loop does is undone.
    """
    pairs = zip(response.time_constant_s[:2], response.acceleration_lag_s[:2], strict=True)
    return response.latency_s + max(behind_s or lag_s for lag_s, behind_s in pairs)


def slowness(response: Response) -> float:
    """Return how many times slower than tuned a law is to be; 1 for a vehicle that is quick enough."""
    return min(max(delay_s(response) / _AS_TUNED_S, 1.0), _MOST)


def lateness_s(response: Response) -> float:
    """Return the delay beyond that for which laws are tuned, s."""
    return max(delay_s(response) - _AS_TUNED_S, 0.0)


def slowed(profile: Profile, response: Response) -> Profile:
    """Return the profile with its law slowed as the response demands; a law of other weights is left as it is."""
    times = slowness(response)
    weights: Any = profile.table(profile.controller).get("weights")
    if times == 1.0 or not isinstance(weights, dict) or not _WEIGHTS.keys() <= weights.keys():
        return profile
    for name, power in _WEIGHTS.items():
        profile = profile.replace(f"controllers.{profile.controller}.weights.{name}", weights[name] * times**power)
    return profile
