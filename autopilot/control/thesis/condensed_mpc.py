"""The MPC in input increments, condensed to a QP, THESIS [3.13-3.22]."""

from typing import NamedTuple

import numpy as np

from colibri.autopilot.control.interface import Active, Clock, Diagnostics
from colibri.autopilot.control.qp import Qp, QpSolver, box
from colibri.common.matrices import dot, matmul, matvec
from colibri.common.types import Array

_BINDING = 1e-6  # a bound is active if this part of it or less is left


class Weights(NamedTuple):
    """Diagonals of Q, S and R."""

    output: Array
    terminal: Array
    increment: Array


class CondensedQp(NamedTuple):
    """min ½ Δuᵀ H Δu + fᵀ Δu over the horizon."""

    H: Array  # (N · m, N · m)
    f: Array  # (N · m,)
    free: Array  # outputs predicted without increments, (N · p,)
    Gamma: Array  # effect of the increments on them, (N · p, N · m)


class IncrementModel(NamedTuple):
    """State x̃ = [x; u₋₁], input Δu: Ã = [[A, B], [0, I]], B̃ = [B; I], C̃ = [C, 0]."""

    A: Array
    B: Array
    C: Array


def augment(transition: Array, C: Array) -> IncrementModel:
    """Return the increment model; the transition [[Ad, Bd], [0, I]] is Ã, and its last m columns are B̃."""
    n = C.shape[1]
    outputs = np.zeros((len(C), len(transition)))
    outputs[:, :n] = C
    return IncrementModel(transition, transition[:, n:], outputs)


def condense(model: IncrementModel, horizon: int, x: Array, reference: Array, weights: Weights) -> CondensedQp:
    """Eliminate the states: outputs over the horizon are Y = Phi x + Gamma Δu.

    H = Gammaᵀ Q̄ Gamma + R̄ and f = Gammaᵀ Q̄ (Phi x - r), THESIS [3.20] with C folded in; r is `reference`, (N, p).
    """
    p, m = model.C.shape[0], model.B.shape[1]
    responses = np.empty((horizon + 1, *model.C.shape))
    responses[0] = model.C
    for step in range(horizon):
        responses[step + 1] = matmul(responses[step], model.A)
    Phi = responses[1:].reshape(horizon * p, -1)
    markov = matmul(responses[:horizon].reshape(horizon * p, -1), model.B)
    Gamma = np.zeros((horizon * p, horizon * m))
    for column in range(horizon):
        Gamma[column * p :, column * m : (column + 1) * m] = markov[: (horizon - column) * p]
    weighted = Gamma.T * np.concatenate([weights.output] * (horizon - 1) + [weights.terminal])
    H = matmul(weighted, Gamma)
    H.flat[:: horizon * m + 1] += np.concatenate([weights.increment] * horizon)
    free = matvec(Phi, x)
    return CondensedQp(0.5 * (H + H.T), matvec(weighted, free - reference.ravel()), free, Gamma)


class Solution(NamedTuple):
    increment: Array  # the first, (m,); zero if the QP was not solved
    diagnostics: Diagnostics  # `predicted` holds the outputs over the horizon, (N, p)


def solve(qp: CondensedQp, bound: Array, solver: QpSolver, clock: Clock) -> Solution:
    m = len(bound)
    horizon = len(qp.f) // m
    max_increment = np.concatenate([bound] * horizon)
    started_s = clock()
    status, increments, iterations = solver.solve(
        Qp(qp.H, qp.f, box(len(qp.f)), np.concatenate([max_increment, max_increment]))
    )
    solve_time_s = clock() - started_s
    if increments is None:
        return Solution(np.zeros(m), Diagnostics(status, solve_time_s=solve_time_s, qp_iterations=iterations))
    diagnostics = Diagnostics(
        status,
        solve_time_s=solve_time_s,
        cost=dot(increments, 0.5 * matvec(qp.H, increments) + qp.f),
        active=Active(increments=int(np.count_nonzero(np.abs(increments) > (1.0 - _BINDING) * max_increment))),
        predicted=(qp.free + matvec(qp.Gamma, increments)).reshape(horizon, -1),
        qp_iterations=iterations,
    )
    return Solution(increments[:m], diagnostics)
