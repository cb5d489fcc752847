"""Deviations of the whole vehicle, against differences of nominal motions."""

import numpy as np
import pytest

from colibri.autopilot.control.whole_lpv_mpc.deviations import DEVIATIONS, empty_transition, respond
from colibri.autopilot.control.whole_lpv_mpc.model import ROTORS
from colibri.autopilot.control.whole_lpv_mpc.mpc import lagging, model_of
from colibri.common.jit import packed
from colibri.common.rotations import rotation_matrix
from tests.support.whole_mpc import HUMMINGBIRD, INTERVAL_S, STARTS, STEPS, rolled, start


@pytest.mark.parametrize("seed", range(4))
def test_deviations_are_the_motions_derivative(seed: int) -> None:
    numbers = model_of(HUMMINGBIRD, INTERVAL_S)
    means, levels = lagging(STARTS, numbers.lag)
    rigid, squared, commands = start(seed)
    commands[:] = commands[0]
    motion, speeds = rolled(HUMMINGBIRD, rigid, squared, commands)
    responses = np.full((STEPS + 1, DEVIATIONS, ROTORS * (len(STARTS) - 1)), np.nan)
    respond(motion, speeds, means, levels, packed(numbers), empty_transition(STEPS), responses)
    step = 1e-4
    for column in range(responses.shape[2]):
        block, rotor = divmod(column, ROTORS)
        ends = []
        for sign in (1.0, -1.0):
            changed = commands.copy()
            changed[STARTS[block] : STARTS[block + 1], rotor] += sign * step
            ends.append(rolled(HUMMINGBIRD, rigid, squared, changed)[0][-1])
        difference = (ends[0] - ends[1]) / (2.0 * step)
        R = np.array(rotation_matrix(tuple(motion[-1, 6:10])))
        before, after = (np.array(rotation_matrix(tuple(end[6:10]))) for end in ends)
        skew = R.T @ (before - after) / (2.0 * step)
        turned = [skew[2, 1], skew[0, 2], skew[1, 0]]
        expected = np.concatenate([difference[:6], turned, difference[10:]])
        assert responses[-1, :, column] == pytest.approx(expected, rel=0.03, abs=0.03 * np.abs(expected[9:]).max())
