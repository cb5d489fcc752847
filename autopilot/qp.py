"""Quadratic programs through qpsolvers; the one place that knows it. Every result is a value, never an exception."""

from enum import StrEnum
from functools import cache
from typing import Any, NamedTuple, TypeAlias
from warnings import catch_warnings, simplefilter

import numpy as np
import qpsolvers
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

Array: TypeAlias = NDArray[np.float64]

IN_SOLVERS_EXTRA = ("daqp", "highs", "osqp", "piqp", "proxqp", "quadprog", "scs")
"""What `pip install colibri-sitl[solvers]` brings, by the names that qpsolvers uses."""

_MAX_ITERATIONS = 100_000


class SolverError(Exception):
    """A solver that cannot be used; the message says what to do."""


class QpStatus(StrEnum):
    """How a QP ended."""

    SOLVED = "solved"
    NOT_SOLVED = "not solved"
    FAILED = "failed"


class QpResult(NamedTuple):
    """The solution (n,), or None with the status that says why there is none."""

    status: QpStatus
    x: Array | None


class QpSolver:
    """One solver of qpsolvers, held to a tolerance."""

    def __init__(self, name: str, tolerance: float) -> None:
        """Use solver `name`; those that work to a tolerance stop at `tolerance`.

        Raises:
            SolverError: There is no such solver, or it is not installed.
        """
        check_solver(name)
        self._name = name
        self._sparse = name in qpsolvers.sparse_solvers and name not in qpsolvers.dense_solvers
        self._options = _options(name, tolerance)

    def solve(self, H: Array, f: Array, lower: Array, upper: Array) -> QpResult:
        """Minimise ½ xᵀ H x + fᵀ x subject to lower <= x <= upper.

        Args:
            H: Symmetric, positive definite, (n, n).
            f: (n,).
            lower: (n,).
            upper: (n,).
        """
        P, G = _sparse_box(len(f)) if self._sparse else (H, _box(len(f)))
        if self._sparse:
            np.asarray(P.data)[:] = H.ravel()
        try:
            with catch_warnings():
                simplefilter("ignore")
                problem = qpsolvers.Problem(P, f, G, np.concatenate([upper, -lower]))
                solution = qpsolvers.solve_problem(problem, self._name, **self._options)
        except (qpsolvers.QPError, ArithmeticError, ValueError):
            return QpResult(QpStatus.FAILED, None)
        if not solution.found or solution.x is None:
            return QpResult(QpStatus.NOT_SOLVED, None)
        if not np.isfinite(solution.x).all():
            return QpResult(QpStatus.FAILED, None)
        return QpResult(QpStatus.SOLVED, np.asarray(solution.x, dtype=np.float64))


def installed_solvers() -> list[str]:
    """Return the names of the QP solvers that can be used here."""
    return sorted(qpsolvers.available_solvers)


def check_solver(name: str) -> None:
    """Check that a solver can be used.

    Raises:
        SolverError: There is no such solver, or it is not installed.
    """
    if name in qpsolvers.available_solvers:
        return
    if name not in _known_solvers():
        raise SolverError(f"unknown solver {name}: installed are {', '.join(installed_solvers())}")
    extra = "colibri-sitl[solvers]" if name in IN_SOLVERS_EXTRA else f"qpsolvers[{name}]"
    raise SolverError(f"solver {name} is not installed: pip install '{extra}'")


@cache
def _box(n: int) -> Array:
    """Return G of the box G x <= [upper; -lower]."""
    return np.vstack([np.eye(n), -np.eye(n)])


@cache
def _sparse_box(n: int) -> tuple[csc_matrix, csc_matrix]:
    """Return a full P to be filled and the G of the box: to build them anew costs five times what Clarabel takes."""
    return csc_matrix(np.ones((n, n))), csc_matrix(_box(n))


@cache
def _known_solvers() -> frozenset[str]:
    suffix = "_solve_qp"
    return frozenset(entry.removesuffix(suffix) for entry in dir(qpsolvers) if entry.endswith(suffix))


def _options(name: str, tolerance: float) -> dict[str, Any]:
    """Return what each solver calls its tolerances; an active-set solver works to machine precision anyway."""
    absolute_and_relative = {"eps_abs": tolerance, "eps_rel": tolerance}
    options: dict[str, dict[str, Any]] = {
        "clarabel": {"tol_gap_abs": tolerance, "tol_gap_rel": tolerance, "tol_feas": tolerance},
        "osqp": {**absolute_and_relative, "max_iter": _MAX_ITERATIONS},
        "piqp": absolute_and_relative,
        "proxqp": absolute_and_relative,
        "scs": {**absolute_and_relative, "max_iters": _MAX_ITERATIONS},
        "highs": {"primal_feasibility_tolerance": tolerance, "dual_feasibility_tolerance": tolerance},
    }
    return options.get(name, {})
