"""Quadratic Lyapunov functions of an uncertain loop, by semidefinite programs.

Boyd, El Ghaoui, Feron, Balakrishnan, Linear Matrix Inequalities in System and Control Theory, SIAM 1994, ch. 5 and 6.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import combinations_with_replacement
from typing import NamedTuple

import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import solve_discrete_lyapunov

from colibri.certification.loop import RangeError, UncertainLoop, supply
from colibri.common.types import Array

_MAX_ROUNDS = 40
_ADDED = 5
_ENOUGH = 5e-8  # tolerance of an inequality's least eigenvalue
_USABLE = ("Solved", "AlmostSolved", "InsufficientProgress")  # statuses that may come with a solution; a check decides


class Inequality(NamedTuple):
    """constant + Σ_i x_i coefficients_i is positive semidefinite."""

    constant: Array
    coefficients: Array


def minimise(cost: Array, always: Sequence[Inequality], many: Inequality | None = None) -> Array | None:
    """Return the x of least cost, if there is one; of the stack `many`, violated inequalities are added: few bind."""
    total = 0 if many is None else len(many.constant)
    taken = list(range(0, total, max(1, total // _ADDED)))
    for _ in range(_MAX_ROUNDS):
        chosen = [] if many is None else [Inequality(many.constant[i], many.coefficients[i]) for i in taken]
        x = _solve(cost, [*always, *chosen])
        if x is None or many is None:
            return x
        least = np.linalg.eigvalsh(many.constant + np.tensordot(many.coefficients, x, (1, 0)))[:, 0]
        violated = [int(i) for i in np.argsort(least) if least[i] < -_ENOUGH and int(i) not in taken]
        if not violated:
            return x
        taken += violated[:_ADDED]
    return None


def _solve(cost: Array, inequalities: Sequence[Inequality]) -> Array | None:
    rows = sparse.csc_matrix(np.vstack([-_vectors(item.coefficients).T for item in inequalities]))
    constants = np.concatenate([_vectors(item.constant) for item in inequalities])
    cones = [clarabel.PSDTriangleConeT(item.constant.shape[-1]) for item in inequalities]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    # The problems are scaled well, and dense: with either of these Clarabel gave up on feasible ones.
    settings.equilibrate_enable, settings.chordal_decomposition_enable = False, False
    size = len(cost)
    nothing = sparse.csc_matrix((size, size))
    solution = clarabel.DefaultSolver(nothing, cost, rows, constants, cones, settings).solve()
    return np.array(solution.x) if str(solution.status) in _USABLE else None


def _vectors(matrices: Array) -> Array:
    """Return the upper triangles of (..., k, k), by columns, off-diagonals times √2."""
    columns, rows = np.tril_indices(matrices.shape[-1])
    return matrices[..., rows, columns] * np.where(rows == columns, 1.0, np.sqrt(2.0))


_LEAST_MARGIN = 1e-6  # smallest decrease of a Lyapunov function about the identity
_BISECTIONS = 6
_SET_RATIOS = (0.98, 0.95, 0.99)
_ATTRACTOR_RATIOS = (0.95, 0.98, 0.99)  # ratios of V between samples, in order of trial; slower decay gives larger sets
_STAGE_BESIDE = 1e-6  # covers states without stage cost
_ROUNDING = 1e-6  # covers the solver's errors of up to about 1e-7
_SPARE = 1e-4  # relative margin of all constraints, for the solver's errors


class Proof(NamedTuple):
    """P, (n, n), multipliers, sizes, and ratio of a decrease of V = zᵀPz, as in `loop.decrease`."""

    P: Array
    multipliers: Array
    sizes: Array
    ratio: float

    def reach(self, rows: Array) -> Array:
        """Return the largest f z of rows f, (l, n), where V <= 1."""
        reached: Array = np.sqrt(np.einsum("li,ij,lj->l", rows, np.linalg.inv(self.P), rows))
        return reached


class _Problem:
    """Semidefinite programs of a loop in coordinates ζ = C z."""

    def __init__(self, loop: UncertainLoop, C: Array) -> None:
        X = np.linalg.inv(C)
        loop = loop.distinct()
        self.C, self.sizes = C, np.linalg.norm(loop.channels @ X, axis=1)
        self.size = len(C)
        self.limits, self.stage, self.starts = loop.limits @ X, X.T @ loop.stage @ X, loop.starts @ C.T
        self.outputs = loop.starts / np.sum(loop.starts**2, axis=1)[:, None] @ X
        quadratic = supply(loop, self.sizes)
        entered = np.linalg.norm(C @ loop.entries, axis=0)
        self._units = np.sqrt((loop.gains @ self.sizes + loop.offsets) / entered)  # so that multipliers are about 1
        squared = self._units[:, None, None] ** 2
        self.forms = X.T @ quadratic.forms @ X / squared
        self.constants = quadratic.constants / self._units**2
        entries = np.hstack([C @ loop.entries * self._units, C @ loop.disturbance])
        beside = np.broadcast_to(entries, (len(loop.vertices), *entries.shape))
        self._moved = np.concatenate([C @ loop.vertices @ X, beside], axis=2)
        self.basis = _basis(loop.blocks(), self.size)
        self._ones = np.ones(min(1, loop.disturbance.shape[1]))
        self.unknowns = len(self.basis) + len(self.forms) + len(self._ones) + 1

    def decrease(self, ratio: float, *, margin: bool = False, stage: bool = False) -> Inequality:
        """LMI: V decreases at every vertex, by the last unknown more, or by the stage cost."""
        n, m, b = self.size, len(self.forms), len(self.basis)
        vertices, size = len(self._moved), self._moved.shape[2]
        coefficients = np.zeros((vertices, self.unknowns, size, size))
        weighted = np.einsum("jab,vbk->vjak", self.basis, self._moved, optimize=True)
        coefficients[:, :b] = -np.einsum("vai,vjak->vjik", self._moved, weighted, optimize=True)
        coefficients[:, :b, :n, :n] += ratio * self.basis
        coefficients[:, b : b + m, :n, :n] = -self.forms
        for i in range(n, size):
            coefficients[:, b + min(i - n, m), i, i] = 1.0
        constant = np.tile(-_ROUNDING * np.eye(size), (vertices, 1, 1))
        if margin:
            coefficients[:, -1] = -np.eye(size)
        if stage:
            constant[:, :n, :n] -= (1.0 + _SPARE) * self.stage
        return Inequality(constant, coefficients)

    def spread(self) -> Array:
        cost = np.zeros(self.unknowns)
        cost[: len(self.basis)] = [np.sum(self.starts @ B * self.starts) for B in self.basis]
        return cost

    def bounded(self, constant: Array, sign: float, last: Array | None = None) -> Inequality:
        coefficients = np.zeros((self.unknowns, self.size, self.size))
        coefficients[: len(self.basis)] = sign * self.basis
        if last is not None:
            coefficients[-1] = last
        return Inequality(constant, coefficients)

    def within(self, row: Array) -> Inequality:
        """LMI: |f ζ| <= 1 in the set V <= 1."""
        n = self.size
        constant, coefficients = np.zeros((n + 1, n + 1)), np.zeros((self.unknowns, n + 1, n + 1))
        constant[:n, n] = constant[n, :n] = row * (1.0 + _SPARE)
        constant[n, n] = 1.0
        coefficients[: len(self.basis), :n, :n] = self.basis
        return Inequality(constant, coefficients)

    def supplied(self, ratio: float) -> Inequality:
        """LMI: at V = 1 the decrease of V outweighs the disturbance."""
        coefficients = np.zeros((self.unknowns, 1, 1))
        coefficients[len(self.basis) : -1, 0, 0] = -np.append(self.constants, self._ones)
        return Inequality(np.array([[(1.0 - ratio) * (1.0 - _SPARE)]]), coefficients)

    def proof(self, x: Array, ratio: float) -> Proof:
        b = len(self.basis)
        P = self.C.T @ np.tensordot(x[:b], self.basis, 1) @ self.C
        return Proof(0.5 * (P + P.T), x[b:-1] / np.append(self._units, self._ones) ** 2, self.sizes, ratio)


def contraction(loop: UncertainLoop, ratio: float) -> Proof | None:
    """Find a decrease by `ratio` each sample, without disturbance."""
    C = _coordinates_of_set(loop)
    if C is None or spectral_radius(loop) ** 2 >= ratio:
        return None
    problem = _Problem(loop.undisturbed(), C)
    cost = np.zeros(problem.unknowns)
    cost[-1] = -1.0
    x = minimise(cost, [problem.bounded(np.eye(problem.size), -1.0)], problem.decrease(ratio, margin=True))
    return problem.proof(x, ratio) if x is not None and x[-1] > _LEAST_MARGIN else None


def fastest(loop: UncertainLoop) -> Proof | None:
    found = _bisected(1.0, spectral_radius(loop) ** 2, lambda ratio: contraction(loop, ratio))
    return found and found[1]


def spectral_radius(loop: UncertainLoop) -> float:
    return float(np.abs(np.linalg.eigvals(loop.vertices)).max())


def largest_scale(loop_at: Callable[[float], UncertainLoop], least: float) -> tuple[float, Proof] | None:
    """Find the largest scale of the ranges, by bisection."""

    def found_at(scale: float) -> Proof | None:
        with suppress(RangeError):
            return contraction(loop_at(scale), 1.0)
        return None

    return _bisected(least, 1.0, found_at)


def _bisected(good: float, bad: float, find: Callable[[float], Proof | None]) -> tuple[float, Proof] | None:
    best = find(good)
    if best is None:
        return None
    for _ in range(_BISECTIONS):
        middle = 0.5 * (good + bad)
        found = find(middle)
        good, bad, best = (middle, bad, found) if found else (good, middle, best)
    return good, best


def invariant_set(loop: UncertainLoop) -> Proof | None:
    """Find the largest set V <= 1 that is never left, within the limits."""
    return _first(loop, _SET_RATIOS, _set_program)


def attractor(loop: UncertainLoop) -> Proof | None:
    """Find the smallest set V <= 1 that trajectories tend to."""
    return _first(loop, _ATTRACTOR_RATIOS, _attractor_program)


def terminal_weight(loop: UncertainLoop) -> Proof | None:
    """Find the least S with a decrease of zᵀSz by the stage cost."""
    C = _coordinates(loop, loop.stage + _STAGE_BESIDE * np.diag(np.diag(loop.limits.T @ loop.limits)))
    if C is None:
        return None
    problem = _Problem(loop.undisturbed(), C)
    cost = np.zeros(problem.unknowns)
    cost[: len(problem.basis)] = np.trace(problem.basis, axis1=1, axis2=2)
    x = minimise(cost, [], problem.decrease(1.0, stage=True))
    return problem.proof(x, 1.0) if x is not None else None


def _set_program(problem: _Problem, ratio: float) -> tuple[Array, list[Inequality]]:
    return problem.spread(), [problem.supplied(ratio), *(problem.within(row) for row in problem.limits)]


def _attractor_program(problem: _Problem, ratio: float) -> tuple[Array, list[Inequality]]:
    cost = np.zeros(problem.unknowns)
    cost[-1] = -1.0
    zero = np.zeros((problem.size, problem.size))
    return cost, [problem.supplied(ratio), problem.bounded(zero, 1.0, -(problem.outputs.T @ problem.outputs))]


def _first(
    loop: UncertainLoop, ratios: tuple[float, ...], program: Callable[[_Problem, float], tuple[Array, list[Inequality]]]
) -> Proof | None:
    """Solve for the first feasible ratio, then again with its set as a ball."""

    def solved(C: Array | None, ratio: float) -> Proof | None:
        if C is None or spectral_radius(loop) ** 2 >= ratio:
            return None
        problem = _Problem(loop, C)
        cost, always = program(problem, ratio)
        x = minimise(cost, always, problem.decrease(ratio))
        return problem.proof(x, ratio) if x is not None else None

    first = _coordinates_of_set(loop)
    found = next(filter(None, (solved(first, ratio) for ratio in ratios)), None)
    return found and (solved(_root(found.P, loop), found.ratio) or found)


def _coordinates(loop: UncertainLoop, weight: Array) -> Array | None:
    """Return C: V = |C z|² decreases by zᵀ weight z in the polytope's middle, if stable."""
    middle = loop.vertices.mean(axis=0)
    radius = float(np.abs(np.linalg.eigvals(middle)).max())
    if radius >= 1.0:
        return None
    P = solve_discrete_lyapunov(middle.T / np.sqrt(0.5 * (1.0 + radius**2)), weight)
    return _root(P, loop)


def _coordinates_of_set(loop: UncertainLoop) -> Array | None:
    C = _coordinates(loop, loop.stage + loop.limits.T @ loop.limits)
    if C is None:
        return None
    nearest: float = np.linalg.norm(loop.limits @ np.linalg.inv(C), axis=1).max()
    return C * nearest


def _root(P: Array, loop: UncertainLoop) -> Array | None:
    """Return C with CᵀC = P, if P is positive definite."""
    C = np.zeros_like(P)
    for block in loop.blocks():
        part = np.ix_(block, block)
        try:
            C[part] = np.linalg.cholesky(P[part]).T
        except np.linalg.LinAlgError:
            return None
    return C


def _basis(blocks: list[list[int]], size: int) -> Array:
    pairs = [pair for block in blocks for pair in combinations_with_replacement(block, 2)]
    basis = np.zeros((len(pairs), size, size))
    for matrix, (i, j) in zip(basis, pairs, strict=True):
        matrix[i, j] = matrix[j, i] = 1.0
    return basis
