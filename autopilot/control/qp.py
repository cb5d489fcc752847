"""Quadratic programs by DAQP, Clarabel or any qpsolvers solver; failures are statuses, not exceptions."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import cache, lru_cache
from math import nan
from typing import Any, NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.errors import AutopilotError
from colibri.common.errors import unknown
from colibri.common.types import Array

IN_SOLVERS_EXTRA = ("highs", "osqp", "piqp", "proxqp", "quadprog", "scs")

MAX_RESIDUAL = 1e-6  # largest accepted violation of the optimality conditions

MAX_ITERATIONS = 100_000

_DAQP, _CLARABEL = "daqp", "clarabel"
_UNBOUNDED = 1e30
_NONE = np.empty(0)
_PATTERNS = 64


class SolverError(AutopilotError):
    """A solver that cannot be used; the message names the remedy."""


class QpStatus(StrEnum):
    """Result of a QP."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    TIME_OUT = "time-out"  # iteration limit: counted, not timed, to keep flights repeatable
    NOT_ACCURATE = "not accurate"  # not finite, or outside the optimality conditions


class Qp(NamedTuple):
    """min ½ xᵀHx + fᵀx with G x <= h, lower <= x <= upper."""

    H: Array  # symmetric, positive definite, (n, n)
    f: Array  # (n,)
    G: Array  # (m, n)
    h: Array  # (m,)
    lower: Array = _NONE  # (n,), or (0,) without bounds
    upper: Array = _NONE  # (n,), or (0,) without bounds


class QpResult(NamedTuple):
    status: QpStatus
    x: Array | None  # the solution, (n,)
    iterations: float = nan  # nan if the solver gives no count


class QpSolver:
    """One QP solver at a tolerance; raises a SolverError if unavailable."""

    def __init__(self, name: str, tolerance: float, max_iterations: int = MAX_ITERATIONS) -> None:
        check_solver(name)
        from colibri.autopilot.control.qp_residual import residual  # compiled: who only reads a result does without

        self._residual = residual
        options = _options(name, tolerance, max_iterations)
        self._optimum: Callable[[Qp], _Optimum] = (
            _Daqp(options) if name == _DAQP else _Clarabel(options) if name == _CLARABEL else _Qpsolvers(name, options)
        )
        self._nearest = _Daqp({"iter_limit": MAX_ITERATIONS})
        self.solve(Qp(np.eye(1), np.zeros(1), np.eye(1), np.ones(1)))  # completes lazy imports before any flight

    def solve(self, qp: Qp) -> QpResult:
        try:
            optimum = self._optimum(qp)
        except (ArithmeticError, ValueError, RuntimeWarning):
            return QpResult(QpStatus.NOT_ACCURATE, None)
        if optimum.x is None:
            return QpResult(self._why_none(qp), None, optimum.iterations)
        x = np.array(optimum.x, dtype=np.float64)  # a copy: some solvers return read-only arrays
        if self._residual(*qp, x, _some(optimum.z), _some(optimum.z_box)) > MAX_RESIDUAL:
            return QpResult(QpStatus.NOT_ACCURATE, None, optimum.iterations)
        return QpResult(QpStatus.SOLVED, x, optimum.iterations)

    def _why_none(self, qp: Qp) -> QpStatus:
        """Return the status of an unsolved QP: out of time if any point satisfies its constraints, else infeasible."""
        if not all(np.isfinite(part).all() for part in (qp.H, qp.f, qp.G, qp.h)):
            return QpStatus.NOT_ACCURATE
        nearest = self._nearest(qp._replace(H=np.eye(len(qp.f)), f=np.zeros(len(qp.f))))
        return QpStatus.INFEASIBLE if nearest.x is None else QpStatus.TIME_OUT


class _Optimum(NamedTuple):
    """Solution, multipliers, iterations."""

    x: Array | None
    z: Array | None
    z_box: Array | None
    iterations: float


class _Daqp:
    """DAQP without qpsolvers, which would load every solver, and SciPy."""

    def __init__(self, options: dict[str, Any]) -> None:
        import daqp

        self._daqp = daqp
        self._options = options

    def __call__(self, qp: Qp) -> _Optimum:
        bounds, rows = len(qp.upper), len(qp.h)
        upper = np.concatenate((qp.upper, qp.h))
        lower = np.full(bounds + rows, -_UNBOUNDED)
        lower[:bounds] = qp.lower
        kinds = np.zeros(bounds + rows, dtype=np.intc)
        x, _, code, found = self._daqp.solve(qp.H, qp.f, qp.G, upper, lower, kinds, **self._options)
        multipliers = found["lam"]
        return _Optimum(x if code > 0 else None, multipliers[bounds:], multipliers[:bounds], found["iterations"])


class _Clarabel:
    """Clarabel without qpsolvers, whose detour takes longer than Clarabel."""

    def __init__(self, options: dict[str, Any]) -> None:
        import clarabel

        self._clarabel = clarabel
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        for option, value in options.items():
            setattr(self._settings, option, value)

    def __call__(self, qp: Qp) -> _Optimum:
        n, rows = len(qp.upper), len(qp.h)
        G, h = qp.G, qp.h
        if n:
            G, h = np.concatenate((G, -np.eye(n), np.eye(n))), np.concatenate((h, -qp.lower, qp.upper))
        cones = [self._clarabel.NonnegativeConeT(len(h))]
        problem = (_filled("P", qp.H), qp.f, _filled("G", G), h, cones, self._settings)
        try:
            found = self._clarabel.DefaultSolver(*problem).solve()
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # where Rust panics, that is no Exception
            raise ValueError(str(error)) from error
        if found.status != self._clarabel.SolverStatus.Solved:
            return _Optimum(None, None, None, nan)
        z = np.array(found.z)
        return _Optimum(np.array(found.x), z[:rows], z[rows + n :] - z[rows : rows + n], nan)


class _Qpsolvers:
    """Any other solver."""

    def __init__(self, name: str, options: dict[str, Any]) -> None:
        import qpsolvers

        self._qpsolvers = qpsolvers
        self._name = name
        self._sparse = name in qpsolvers.sparse_solvers and name not in qpsolvers.dense_solvers
        self._options = options

    def __call__(self, qp: Qp) -> _Optimum:
        try:
            solution = self._quietly(qp) if self._sparse else self._solution(qp, qp.H, qp.G)
        except self._qpsolvers.QPError as error:
            raise ValueError(str(error)) from error
        x = solution.x if solution.found else None
        return _Optimum(x, solution.z, solution.z_box, _iterations(solution.extras))

    def _solution(self, qp: Qp, P: Any, G: Any) -> Any:
        problem = self._qpsolvers.Problem(P, qp.f, G, qp.h, lb=_or_none(qp.lower), ub=_or_none(qp.upper))
        return self._qpsolvers.solve_problem(problem, self._name, **self._options)

    def _quietly(self, qp: Qp) -> Any:
        with catch_warnings():
            simplefilter("ignore")
            return self._solution(qp, _filled("P", qp.H), _filled("G", qp.G))


def _iterations(extras: Mapping[str, Any]) -> float:
    if "iterations" in extras:  # quadprog's: of constraints added, and of constraints dropped
        return float(sum(extras["iterations"]))
    return float(getattr(extras.get("info"), "iter", extras.get("iter", nan)))


def _some(vector: Array | None) -> Array:
    return _NONE if vector is None else np.ascontiguousarray(vector, dtype=np.float64)


def _or_none(vector: Array) -> Array | None:
    return vector if vector.size else None


def installed_solvers() -> list[str]:
    import qpsolvers

    return sorted(qpsolvers.available_solvers)


def check_solver(name: str) -> None:
    if name in (_DAQP, _CLARABEL):  # as numpy is, always
        return
    import qpsolvers

    if name in qpsolvers.available_solvers:
        return
    if not hasattr(qpsolvers, f"{name}_solve_qp"):
        raise SolverError(unknown("solver", name, installed_solvers()))
    extra = "colibri-sitl[solvers]" if name in IN_SOLVERS_EXTRA else f"qpsolvers[{name}]"
    raise SolverError(f"solver {name} is not installed: pip install '{extra}'")


@cache
def box(n: int) -> Array:
    """Return G of the box G x <= [upper; -lower]."""
    return np.vstack([np.eye(n), -np.eye(n)])


def _filled(role: str, matrix: Array) -> Any:
    """Return a matrix as CSC; a new pattern takes five times Clarabel's time, so it is cached."""
    sparse, places = _pattern(role, matrix.shape, (matrix != 0.0).tobytes())
    matrix.take(places, out=sparse.data, mode="clip")
    return sparse


@lru_cache(maxsize=_PATTERNS)
def _pattern(role: str, shape: tuple[int, int], filled: bytes) -> tuple[Any, NDArray[np.intp]]:
    """Return a matrix with ones where it is filled, and the places of its data in the dense one."""
    from scipy.sparse import csc_matrix

    del role  # two matrices of one pattern are two matrices
    sparse = csc_matrix(np.frombuffer(filled, dtype=np.bool_).reshape(shape).astype(np.float64))
    columns = np.repeat(np.arange(shape[1]), np.diff(sparse.indptr))
    return sparse, sparse.indices * shape[1] + columns


def _options(name: str, tolerance: float, max_iterations: int) -> dict[str, Any]:
    absolute_and_relative = {"eps_abs": tolerance, "eps_rel": tolerance}
    options: dict[str, dict[str, Any]] = {
        "clarabel": {
            **{f"tol_{what}": tolerance for what in ("gap_abs", "gap_rel", "feas")},
            "max_iter": max_iterations,
        },
        "daqp": {"iter_limit": max_iterations},
        "osqp": {**absolute_and_relative, "max_iter": max_iterations},
        "piqp": {**absolute_and_relative, "max_iter": max_iterations},
        "proxqp": {**absolute_and_relative, "max_iter": max_iterations},
        "scs": {**absolute_and_relative, "max_iters": max_iterations},
        "highs": {
            **{f"{what}_feasibility_tolerance": tolerance for what in ("primal", "dual")},
            "qp_iteration_limit": max_iterations,
        },
    }
    return options.get(name, {})
