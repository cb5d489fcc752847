"""The QP and the plan read from it: bounds that always hold the nominal plan, free minima, soft limits."""

import numpy as np
import pytest

from colibri.autopilot.control.lpv_mpc import constraints, planning, solution
from colibri.autopilot.control.qp import Qp, QpSolver

STARTS, ROTORS = np.array([0, 1, 3, 6]), 4


def random_qp(seed: int, room: float) -> Qp:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(12, 12))
    bound = np.full(12, room)
    return Qp(root @ root.T + np.eye(12), rng.normal(size=12), np.zeros((0, 12)), np.zeros(0), -bound, bound)


@pytest.mark.parametrize("seed", range(5))
def test_a_free_minimum_is_the_solvers(seed: int) -> None:
    qp, z = random_qp(seed, 10.0), np.empty(12)
    assert solution.free_minimum(qp, 3, ROTORS, z)
    solved = QpSolver("daqp", 1e-10).solve(qp).x
    assert solved is not None
    assert z == pytest.approx(solved, abs=1e-9)


@pytest.mark.parametrize("spoil", ["bound", "indefinite", "not a number"])
def test_what_is_beyond_a_bound_or_has_no_minimum_is_not_free(spoil: str) -> None:
    qp, z = random_qp(0, 10.0 if spoil != "bound" else 1e-3), np.empty(12)
    if spoil == "indefinite":
        qp.H[3, 3] = -1.0
    if spoil == "not a number":
        qp.f[2] = np.nan
    assert not solution.free_minimum(qp, 3, ROTORS, z)


@pytest.mark.parametrize("seed", range(5))
def test_bounds_keep_the_commands_within_their_limits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = np.stack([np.full(6, 0.01), rng.uniform(0.6, 1.0, 6)], axis=1)
    commands = rng.uniform(limits[:, :1], limits[:, 1:], (6, ROTORS))
    corrections, lower, upper = rng.normal(size=(3, ROTORS)), np.empty(12), np.empty(12)
    constraints.bound(commands, limits, corrections, STARTS, lower, upper)
    assert (lower <= 0.0).all()
    assert (upper >= 0.0).all()
    for z in (lower, upper):
        held = commands + np.repeat(corrections + z.reshape(3, ROTORS), np.diff(STARTS), axis=0)
        assert (held >= limits[:, :1] - 1e-12).all()
        assert (held <= limits[:, 1:] + 1e-12).all()


def test_a_block_of_extreme_commands_keeps_a_correction() -> None:
    limits = np.tile([0.0, 1.0], (6, 1))
    commands = np.tile(np.array([0.4, 0.6, 0.5, 0.0, 1.0, 1.0])[:, None], ROTORS)
    planning.ease(commands, STARTS, limits)
    assert commands[:3, 0].tolist() == [0.4, 0.6, 0.5]
    assert commands[3:, 0].tolist() == [0.25, 0.75, 0.75]
