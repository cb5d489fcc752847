"""QPs: optimal by the KKT conditions with every installed solver, and never an exception."""

from collections.abc import Callable
from math import isnan
from typing import Any

import numpy as np
import pytest
import qpsolvers
from scipy.optimize import linprog

from colibri.autopilot.control.qp import IN_SOLVERS_EXTRA, Qp, QpSolver, QpStatus, SolverError, box, installed_solvers
from colibri.common.types import Array

TOLERANCE = 1e-10


def random_qp(seed: int, n: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    return root @ root.T + np.eye(n), 5.0 * rng.normal(size=n)


def bounded(H: Array, f: Array, bound: float) -> Qp:
    n = len(f)
    return Qp(H, f, np.empty((0, n)), np.empty(0), np.full(n, -bound), np.full(n, bound))


def in_a_box(H: Array, f: Array, bound: float) -> Qp:
    return Qp(H, f, box(len(f)), np.full(2 * len(f), bound))


@pytest.mark.parametrize("name", installed_solvers())
@pytest.mark.parametrize("limited", [in_a_box, bounded])
@pytest.mark.parametrize("bound", [0.05, 100.0])
def test_the_solution_is_optimal(name: str, bound: float, limited: Callable[[Array, Array, float], Qp]) -> None:
    """Projected gradient: x is optimal in a box just if a gradient step from it is cut back to it."""
    for seed in range(5):
        H, f = random_qp(seed, 12)
        result = QpSolver(name, TOLERANCE).solve(limited(H, f, bound))
        assert result.status is QpStatus.SOLVED
        assert result.x is not None
        assert np.clip(result.x - (H @ result.x + f), -bound, bound) == pytest.approx(result.x, abs=1e-6)


@pytest.mark.parametrize("name", installed_solvers())
def test_rows_and_bounds_together(name: str) -> None:
    """A row G that is no box, with bounds beside it, and as many rows as variables: the same point from all."""
    H, f = random_qp(3, 6)
    G = np.random.default_rng(4).normal(size=(6, 6))
    qp = Qp(H, f, G, np.full(6, 0.1), np.full(6, -0.2), np.full(6, 0.2))
    result, reference = QpSolver(name, TOLERANCE).solve(qp), QpSolver("clarabel", TOLERANCE).solve(qp)
    assert result.x is not None
    assert result.x == pytest.approx(reference.x, abs=1e-6)
    assert (G @ result.x).max() == pytest.approx(0.1, abs=1e-6)


@pytest.mark.filterwarnings("ignore:Converted matrix")
@pytest.mark.parametrize("bounded", [False, True])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("daqp", {"iter_limit": 100_000}),
        ("clarabel", dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), TOLERANCE)),
    ],
)
def test_a_direct_solver_equals_qpsolvers_bit_for_bit(name: str, options: dict[str, Any], *, bounded: bool) -> None:
    solver = QpSolver(name, TOLERANCE)
    for seed in range(20):
        H, f = random_qp(seed, 12)
        G = np.random.default_rng(seed).normal(size=(8, 12))
        bounds = (np.full(12, -0.2), np.full(12, 0.2)) if bounded else ()
        result = solver.solve(Qp(H, f, G, np.full(8, 0.05), *bounds))
        problem = qpsolvers.Problem(H, f, G, np.full(8, 0.05), None, None, *bounds)
        solution = qpsolvers.solve_problem(problem, name, **options)
        assert result.x is not None
        assert solution.x is not None
        assert result.x.tobytes() == solution.x.tobytes()


@pytest.mark.parametrize("name", ["daqp", "osqp", "piqp", "proxqp", "quadprog", "scs"])
def test_iterations_are_counted_and_grow_with_what_binds(name: str) -> None:
    H, f = random_qp(0, 12)
    easy, hard = (QpSolver(name, TOLERANCE).solve(in_a_box(H, f, bound)) for bound in (100.0, 0.05))
    assert 0 < easy.iterations < hard.iterations
    assert hard.iterations == QpSolver(name, TOLERANCE).solve(in_a_box(H, f, 0.05)).iterations


@pytest.mark.parametrize("name", ["clarabel", "highs"])
def test_iterations_that_a_solver_does_not_say_are_unknown(name: str) -> None:
    assert isnan(QpSolver(name, TOLERANCE).solve(in_a_box(*random_qp(0, 12), 0.05)).iterations)


def test_the_extra_and_the_profiles_solvers_are_installed() -> None:
    assert {*IN_SOLVERS_EXTRA, "clarabel", "daqp"} <= set(installed_solvers())


@pytest.mark.parametrize("name", ["clarabel", "daqp", "quadprog", "piqp"])
def test_an_empty_box_is_infeasible(name: str) -> None:
    assert QpSolver(name, TOLERANCE).solve(in_a_box(*random_qp(0, 6), -1.0))[:2] == (QpStatus.INFEASIBLE, None)


def test_an_unsolved_qp_is_infeasible_as_a_linear_program() -> None:
    solver, found = QpSolver("daqp", TOLERANCE, max_iterations=1), set()
    for seed in range(100):
        rng = np.random.default_rng(seed)
        H, f = random_qp(seed, 6)
        G, h, upper = 100.0 * rng.normal(size=(12, 6)), rng.normal(size=12) + 0.8, np.abs(rng.normal(size=6))
        status = solver.solve(Qp(H, f, G, h, -upper, upper)).status
        feasible = linprog(np.zeros(6), A_ub=G, b_ub=h, bounds=list(zip(-upper, upper, strict=True))).status == 0
        assert status is (QpStatus.TIME_OUT if feasible else QpStatus.INFEASIBLE)
        found.add(status)
    assert len(found) == 2


@pytest.mark.parametrize("name", ["clarabel", "daqp", "piqp", "osqp"])
def test_too_few_iterations_are_a_time_out(name: str) -> None:
    qp = in_a_box(*random_qp(0, 12), 0.05)
    assert QpSolver(name, TOLERANCE, max_iterations=2).solve(qp)[:2] == (QpStatus.TIME_OUT, None)


@pytest.mark.parametrize("limited", [in_a_box, bounded])
@pytest.mark.parametrize("off", [1e-3, np.nan, np.inf])
def test_a_solution_that_is_none_is_not_accurate(
    monkeypatch: pytest.MonkeyPatch, off: float, limited: Callable[[Array, Array, float], Qp]
) -> None:
    solve_problem = qpsolvers.solve_problem

    def sloppy(*args: Any, **options: Any) -> Any:
        solution = solve_problem(*args, **options)
        solution.x = solution.x + off * np.eye(12)[3]
        return solution

    qp = limited(*random_qp(0, 12), 100.0)
    assert QpSolver("quadprog", TOLERANCE).solve(qp).status is QpStatus.SOLVED
    monkeypatch.setattr(qpsolvers, "solve_problem", sloppy)
    assert QpSolver("quadprog", TOLERANCE).solve(qp)[:2] == (QpStatus.NOT_ACCURATE, None)


@pytest.mark.parametrize("name", ["clarabel", "quadprog", "daqp", "piqp"])
@pytest.mark.parametrize("spoilt", ["H", "f"])
def test_nan_is_a_value(name: str, spoilt: str) -> None:
    H, f = random_qp(0, 6)
    (H if spoilt == "H" else f).flat[0] = np.nan
    result = QpSolver(name, TOLERANCE).solve(in_a_box(H, f, 1.0))
    assert result[:2] == (QpStatus.NOT_ACCURATE, None)


def test_a_solver_that_is_not_installed_names_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SolverError, match=r"gurobi is not installed: pip install 'qpsolvers\[gurobi\]'"):
        QpSolver("gurobi", TOLERANCE)
    monkeypatch.setattr(qpsolvers, "available_solvers", ["clarabel"])
    with pytest.raises(SolverError, match=r"piqp is not installed: pip install 'colibri-sitl\[solvers\]'"):
        QpSolver("piqp", TOLERANCE)
