"""Flatness: what references ask for, flown by the model, is the reference."""

import numpy as np
import pytest

from colibri.autopilot.control.lpv_mpc import feed_forward, model
from colibri.autopilot.control.lpv_mpc.feed_forward import Flat
from colibri.autopilot.control.lpv_mpc.model import RIGID, Disturbance
from colibri.autopilot.control.vehicle_model.mixer import exact_inverse
from colibri.common.rotations import quaternion_from_euler
from tests.support.lpv_mpc import CALM, LAP_STEPS, MODEL, PACKED, ROTORS, WIDE, circle

FROM_WRENCH = exact_inverse(MODEL.allocation)
LEVEL = np.array([0.0] * 6 + [1.0] + [0.0] * 6)


def flat() -> Flat:
    n = LAP_STEPS + 2
    return Flat(np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((LAP_STEPS, 3)), np.empty((LAP_STEPS + 1, ROTORS)))


@pytest.mark.parametrize("disturbance", [CALM, Disturbance(np.array([0.5, -1.0, 0.7]), np.array([0.02, -0.01, 0.003]))])
def test_what_a_circle_asks_for_flies_the_circle(disturbance: Disturbance) -> None:
    p, v, a, yaw = circle(3.0, 3.0)
    asked = flat()
    feed_forward.ask(LEVEL, v, a, yaw, disturbance, WIDE, FROM_WRENCH, PACKED, asked)
    commands, limits = np.empty((LAP_STEPS, ROTORS)), np.tile([0.01, 1.0], (LAP_STEPS, 1))
    feed_forward.lead(asked.squared, MODEL.lag.left, limits, commands)
    R = asked.attitudes[0]
    psi, theta, phi = np.arctan2(R[1, 0], R[0, 0]), -np.arcsin(R[2, 0]), np.arctan2(R[2, 1], R[2, 2])
    rate = 2.0 * asked.rates[0] - asked.rates[1]
    rigid = np.concatenate([p[0], v[0], quaternion_from_euler(phi, theta, psi), rate])
    motion, speeds = np.empty((LAP_STEPS + 1, RIGID)), np.empty((LAP_STEPS + 1, ROTORS))
    drive = model.empty_drive(LAP_STEPS, ROTORS)
    model.roll_out(rigid, asked.squared[0], commands, disturbance, PACKED, drive, motion, speeds)
    assert np.abs(motion[:, :3] - p[:-1]).max() < 2e-3
    assert np.abs(motion[:, 3:6] - v[:-1]).max() < 0.03
    assert np.abs(motion[1:, 10:] - asked.rates).max() < 0.05
