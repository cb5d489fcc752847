"""The MPC in input increments, condensed to a QP in the increments alone, THESIS [3.13-3.22]."""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class Weights(NamedTuple):
    """Diagonals of Q (each predicted error), S (the last one) and R (each increment)."""

    output: Array
    terminal: Array
    increment: Array


class CondensedQp(NamedTuple):
    """min ½ Δuᵀ H Δu + fᵀ Δu over the increments of the whole horizon, (horizon · m,)."""

    H: Array
    f: Array


def augment(A: Array, B: Array, C: Array) -> tuple[Array, Array, Array]:
    """Append the last input to the state, so that the decision is its increment.

    x̃ = [x; u₋₁], Ã = [[A, B], [0, I]], B̃ = [B; I], C̃ = [C, 0].
    """
    n, m = B.shape
    A_augmented = np.block([[A, B], [np.zeros((m, n)), np.eye(m)]])
    return A_augmented, np.vstack([B, np.eye(m)]), np.hstack([C, np.zeros((C.shape[0], m))])


def condense(A: Array, B: Array, C: Array, horizon: int, x: Array, reference: Array, weights: Weights) -> CondensedQp:
    """Eliminate the states: outputs over the horizon are an affine function of the increments.

    With Y = Phi x + Gamma Δu: H = Gammaᵀ Q̄ Gamma + R̄ and f = Gammaᵀ Q̄ (Phi x - r), THESIS [3.20] with C folded in.

    Args:
        A: Augmented Ã, (n, n).
        B: Augmented B̃, (n, m).
        C: Augmented C̃, (p, n).
        horizon: N, number of steps.
        x: Present augmented state, (n,).
        reference: r, the output wanted at each step, (N, p).
        weights: Diagonals of Q, S (p,) and R (m,).
    """
    p, m = C.shape[0], B.shape[1]
    rows = np.empty((horizon + 1, p, A.shape[0]))
    rows[0] = C
    for step in range(horizon):
        rows[step + 1] = rows[step] @ A
    markov = rows[:horizon] @ B
    Gamma = np.zeros((horizon * p, horizon * m))
    for column in range(horizon):
        Gamma[column * p :, column * m : (column + 1) * m] = markov[: horizon - column].reshape(-1, m)
    Phi = rows[1:].reshape(horizon * p, -1)
    Q = np.concatenate([*[weights.output] * (horizon - 1), weights.terminal])
    weighted = Gamma.T * Q
    H = weighted @ Gamma
    H[np.diag_indices_from(H)] += np.tile(weights.increment, horizon)
    return CondensedQp(0.5 * (H + H.T), weighted @ (Phi @ x - reference.ravel()))
