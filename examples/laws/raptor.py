"""RAPTOR, a recurrent policy that was trained on a thousand quadrotors (arXiv 2509.11481), as a control law.

    pip install colibri-sitl[raptor]
    colibri arena policy --law flight --law examples/laws/raptor.py

It is given no number of the vehicle. Its axes and rotor order are those of the Crazyflie.
"""

from typing import NamedTuple

import numpy as np
from foundation_policy import QuadrotorPolicy
from scipy.spatial.transform import Rotation

import colibri

FARTHEST_M, FASTEST_M_S = 0.5, 2.0  # errors that it is shown; it was trained near its reference


class Recall(NamedTuple):
    """Its hidden state, and its last action."""

    hidden: np.ndarray
    action: np.ndarray


class Raptor:
    control_interval_us = 10_000
    preview = colibri.Preview(interval_us=10_000, samples=1)

    def __init__(self, settings, vehicle, clock):
        self.frame = colibri.RotorFrame(vehicle, "crazyflie-x")
        self.max_speed = vehicle.rotors.max_speed
        self.policy = QuadrotorPolicy()
        self.memory = next(layer for layer in self.policy.layers if hasattr(layer, "initial_hidden_state"))

    def initial(self, rotor_speed):
        hidden = np.array(self.memory.initial_hidden_state, dtype=np.float64).reshape(1, -1)
        return Recall(hidden, np.full(4, 2.0 * rotor_speed / self.max_speed - 1.0))

    def step(self, memory, time_us, state, references):
        state = self.frame.state(state)
        off = np.clip(state.position_enu_m - references.position_enu_m[0], -FARTHEST_M, FARTHEST_M)
        drift = np.clip(state.velocity_enu_m_s - references.velocity_enu_m_s[0], -FASTEST_M_S, FASTEST_M_S)
        yaw = references.yaw_rad[0] + np.radians(self.frame.yaw_deg)
        level = Rotation.from_euler("z", -yaw).as_matrix()  # the policy holds a heading of zero
        attitude = Rotation.from_quat(np.roll(state.attitude, -1)).as_matrix()
        seen = [*(level @ off), *(level @ attitude).ravel(), *(level @ drift), *state.rate_flu_rad_s, *memory.action]
        self.memory.state = memory.hidden
        action = self.policy.evaluate_step(np.array([seen]))[0]
        speeds = self.frame.to_vehicle(self.max_speed * np.clip(0.5 * (action + 1.0), 0.0, 1.0))
        decision = colibri.Decision(rotor_speeds=speeds, attitude_reference=state.euler)
        return Recall(self.memory.state, action), decision
