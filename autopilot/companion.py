"""The course of an offboard companion: its setpoints, from moment to moment."""

from math import isnan

import numpy as np

from autopilot.attitude_reference import AttitudeReference
from autopilot.courses import Lean, Motion, Scene, Stop
from autopilot.leaning import Leaning
from autopilot.reference import Kind, Target, still_target
from mavlink.setpoints import AttitudeSetpoint, PositionSetpoint


class Companion:
    """The setpoints of an offboard companion; where they end, stop."""

    def __init__(self, attitude: AttitudeReference | None) -> None:
        """Follow setpoints; of attitude if there is a generator of demands for it."""
        self._leaning = Leaning(attitude) if attitude else None
        self._hold = Stop()

    def ask(self, scene: Scene) -> Motion | Lean:
        """Return what the latest setpoint asks for."""
        setpoint = scene.steered.setpoint
        if isinstance(setpoint, PositionSetpoint):
            if self._leaning:
                self._leaning.forget()
            self._hold = Stop()
            return Motion(position_target(setpoint.in_enu(scene.state.euler[2]), scene), scene.behaviour.limits)
        if isinstance(setpoint, AttitudeSetpoint) and self._leaning:
            self._hold = Stop()
            return self._leaning.by_setpoint(setpoint, scene)
        return self._hold.ask(scene)

    def arrived(self, scene: Scene) -> bool:
        """Never by itself."""
        del scene
        return False


def position_target(setpoint: PositionSetpoint, scene: Scene) -> Target:
    """Return a setpoint as a target: each axis bound by the lowest derivative that is given."""
    target = still_target(scene.place, scene.yaw_rad, scene.samples)
    kinds = []
    ahead_s = scene.interval_s * np.arange(scene.samples)
    age_s = (scene.now_us - setpoint.time_us) * 1e-6
    for axis in range(3):
        p, v, a = (
            vector[axis] for vector in (setpoint.position_enu_m, setpoint.velocity_m_s, setpoint.acceleration_m_s2)
        )
        v_or_0, a_or_0 = (0.0 if isnan(value) else value for value in (v, a))
        if not isnan(p):
            kinds.append(Kind.POSITION)
            target.motion[:, 0, axis] = p + v_or_0 * (age_s + ahead_s)
        elif not isnan(v) or isnan(a):
            kinds.append(Kind.VELOCITY)
        else:
            kinds.append(Kind.ACCELERATION)
        target.motion[:, 1, axis] = v_or_0
        target.motion[:, 2, axis] = a_or_0
    x, y, z = kinds
    rate = 0.0 if isnan(setpoint.yaw_rate_rad_s) else setpoint.yaw_rate_rad_s
    target.heading[:, 1] = rate
    if not isnan(setpoint.yaw_rad):
        target.heading[:, 0] = setpoint.yaw_rad
    return target._replace(kinds=(x, y, z), turns=not isnan(setpoint.yaw_rad))
