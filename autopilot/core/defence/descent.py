"""The last resort: brake, descend, stop the rotors on the ground, by the state and the plain law alone."""

import numpy as np

from colibri.autopilot.control.interface import Decision, VehicleState
from colibri.autopilot.core.defence.plain_law import PlainLaw

_SINK_1_S, _LEAST_M_S, _MOST_M_S = 0.5, 0.7, 2.0  # as fast as the height allows
_HELD_FOR_US = 700_000
_SLOWER = 0.3  # part of the commanded sink rate


class Descent:
    """The descent to the ground at z = `ground_m`, ENU; a vehicle that is `standing` stays there."""

    def __init__(self, now_us: int, ground_m: float, *, standing: bool) -> None:
        self._ground_m = ground_m
        self._sinks_since_us = self._held_since_us = now_us
        self.landed = standing

    def step(self, law: PlainLaw, now_us: int, state: VehicleState) -> Decision | None:
        sink_m_s = min(max(_SINK_1_S * (state.position_enu_m[2] - self._ground_m), _LEAST_M_S), _MOST_M_S)
        if now_us - self._sinks_since_us < _HELD_FOR_US or abs(state.velocity_enu_m_s[2]) > _SLOWER * sink_m_s:
            self._held_since_us = now_us
        self.landed = self.landed or now_us - self._held_since_us >= _HELD_FOR_US
        return None if self.landed else law.by_velocity(state, np.array([0.0, 0.0, -sink_m_s]))
