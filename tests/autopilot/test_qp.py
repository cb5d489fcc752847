"""QPs: optimal by the KKT conditions with every installed solver, and never an exception."""

import numpy as np
import pytest
import qpsolvers

from autopilot.lpv import Array
from autopilot.qp import IN_SOLVERS_EXTRA, QpSolver, QpStatus, SolverError, installed_solvers

TOLERANCE = 1e-10


def random_qp(seed: int, n: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    return root @ root.T + np.eye(n), 5.0 * rng.normal(size=n)


@pytest.mark.parametrize("name", installed_solvers())
@pytest.mark.parametrize("bound", [0.05, 100.0])
def test_the_solution_is_optimal(name: str, bound: float) -> None:
    """Projected gradient: x is optimal in a box just if a gradient step from it is cut back to it."""
    for seed in range(5):
        H, f = random_qp(seed, 12)
        box = np.full(12, bound)
        result = QpSolver(name, TOLERANCE).solve(H, f, -box, box)
        assert result.status is QpStatus.SOLVED
        assert result.x is not None
        assert np.clip(result.x - (H @ result.x + f), -box, box) == pytest.approx(result.x, abs=1e-6)


def test_the_extra_and_clarabel_are_installed() -> None:
    assert {*IN_SOLVERS_EXTRA, "clarabel"} <= set(installed_solvers())


def test_an_empty_box_is_a_value() -> None:
    H, f = random_qp(0, 6)
    box = np.ones(6)
    result = QpSolver("clarabel", TOLERANCE).solve(H, f, box, -box)
    assert result.status is not QpStatus.SOLVED
    assert result.x is None


@pytest.mark.parametrize("name", ["clarabel", "quadprog", "daqp", "piqp"])
@pytest.mark.parametrize("spoilt", ["H", "f"])
def test_nan_is_a_value(name: str, spoilt: str) -> None:
    H, f = random_qp(0, 6)
    (H if spoilt == "H" else f).flat[0] = np.nan
    result = QpSolver(name, TOLERANCE).solve(H, f, -np.ones(6), np.ones(6))
    assert result.status is not QpStatus.SOLVED
    assert result.x is None


def test_an_unknown_solver_lists_the_installed_ones() -> None:
    with pytest.raises(SolverError, match="unknown solver simplex: installed are clarabel"):
        QpSolver("simplex", TOLERANCE)


def test_a_solver_that_is_not_installed_names_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SolverError, match=r"gurobi is not installed: pip install 'qpsolvers\[gurobi\]'"):
        QpSolver("gurobi", TOLERANCE)
    monkeypatch.setattr(qpsolvers, "available_solvers", ["clarabel"])
    with pytest.raises(SolverError, match=r"daqp is not installed: pip install 'colibri-sitl\[solvers\]'"):
        QpSolver("daqp", TOLERANCE)
