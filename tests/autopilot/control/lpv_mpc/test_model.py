"""The whole vehicle's model and its deviations, against nominal motions and their differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from colibri.autopilot.control.lpv_mpc.deviations import DEVIATIONS, empty_transition, respond
from colibri.autopilot.control.lpv_mpc.model import Model
from colibri.autopilot.control.lpv_mpc.mpc import lagging, model_of
from colibri.common.jit import packed
from colibri.common.rotations import rotation_matrix
from colibri.plant.physics.world import parameters_of
from tests.support.lpv_mpc import HUMMINGBIRD, INTERVAL_S, ROTORS, STARTS, STEPS, rolled, start
from tests.support.states import derivative


@pytest.mark.parametrize("seed", range(4))
def test_the_nominal_motion_is_the_plants(seed: int) -> None:
    vehicle = HUMMINGBIRD.without(["rotor-lag", "drag"])
    rigid, squared, commands = start(seed)
    motion, _ = rolled(vehicle, rigid, squared, commands)
    R = np.array(rotation_matrix(tuple(rigid[6:10])))
    x = np.concatenate([R.T @ rigid[3:6], rigid[10:], rigid[:3], rigid[6:10]])
    parameters = packed(parameters_of(vehicle, (0.0, 0.0, 0.0)))

    def flow(_: float, x: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        full = np.concatenate([x, speeds, [0.0]])
        return derivative(full, tuple(speeds), parameters)[:13]

    for command in commands:
        speeds = np.sqrt(command) * vehicle.rotors.max_speed
        x = solve_ivp(flow, (0.0, INTERVAL_S), x, args=(speeds,), rtol=1e-10, atol=1e-12).y[:, -1]
    R = np.array(rotation_matrix(tuple(x[9:] / np.linalg.norm(x[9:]))))
    assert motion[-1, :3] == pytest.approx(x[6:9], abs=1e-6)
    assert motion[-1, 3:6] == pytest.approx(R @ x[:3], abs=1e-5)
    assert motion[-1, 10:] == pytest.approx(x[3:6], abs=1e-5)
    assert abs(motion[-1, 6:10] @ x[9:]) == pytest.approx(1.0, abs=1e-6)


def test_rotor_lag_is_linear_and_spin_up_turns_the_body() -> None:
    rigid = np.array([0.0] * 6 + [1.0, 0.0, 0.0, 0.0] + [0.0] * 3)
    commands = np.tile([0.5, 0.3, 0.5, 0.3], (STEPS, 1))
    motion, speeds = rolled(HUMMINGBIRD.without(["drag"]), rigid, np.full(ROTORS, 0.4), commands)
    left = np.exp(-STEPS * INTERVAL_S / 0.025)
    assert speeds[-1] == pytest.approx([0.5 - 0.1 * left, 0.3 + 0.1 * left] * 2)
    rotors = HUMMINGBIRD.rotors
    torque = rotors.torque_coefficient * rotors.max_speed**2
    spin = rotors.inertia_kg_m2 * rotors.max_speed * 2.0 * (np.sqrt(speeds[-1, 0]) - np.sqrt(speeds[-1, 1]))
    dragged = -2.0 * torque * 0.2 * (STEPS * INTERVAL_S - 0.025 * (1.0 - left))
    assert motion[-1, 12] == pytest.approx((dragged - spin) / HUMMINGBIRD.body.inertia_kg_m2[2], rel=1e-3)


def test_rotors_without_lag_have_what_they_are_commanded() -> None:
    numbers = model_of(HUMMINGBIRD.without(["rotor-lag"]), INTERVAL_S)
    assert isinstance(numbers, Model)
    means, levels = lagging(STARTS, numbers.lag)
    assert means[1].tolist() == [0, 1, 1, 0, 0, 0, 0, 0]
    assert levels[1].tolist() == [0, 0, 1, 1, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(("seed", "without"), [(0, []), (1, []), (2, ["rotor-lag"]), (3, ["rotor-lag"])])
def test_deviations_are_the_motions_derivative(seed: int, without: list[str]) -> None:
    vehicle = HUMMINGBIRD.without(without)
    numbers = model_of(vehicle, INTERVAL_S)
    means, levels = lagging(STARTS, numbers.lag)
    rigid, squared, commands = start(seed)
    commands[:] = commands[0]
    motion, speeds = rolled(vehicle, rigid, squared, commands)
    responses = np.zeros((STEPS + 1, DEVIATIONS, ROTORS * (len(STARTS) - 1)))
    respond(motion[:, ::-1].copy(), speeds, means, levels, packed(numbers), empty_transition(STEPS, ROTORS), responses)
    respond(motion, speeds, means, levels, packed(numbers), empty_transition(STEPS, ROTORS), responses)
    step = 1e-4
    for column in range(responses.shape[2]):
        block, rotor = divmod(column, ROTORS)
        ends = []
        for sign in (1.0, -1.0):
            changed = commands.copy()
            changed[STARTS[block] : STARTS[block + 1], rotor] += sign * step
            ends.append(rolled(vehicle, rigid, squared, changed)[0][-1])
        difference = (ends[0] - ends[1]) / (2.0 * step)
        R = np.array(rotation_matrix(tuple(motion[-1, 6:10])))
        before, after = (np.array(rotation_matrix(tuple(end[6:10]))) for end in ends)
        skew = R.T @ (before - after) / (2.0 * step)
        turned = [skew[2, 1], skew[0, 2], skew[1, 0]]
        expected = np.concatenate([difference[:6], turned, difference[10:]])
        assert responses[-1, :, column] == pytest.approx(expected, rel=0.03, abs=0.03 * np.abs(expected[9:]).max())
