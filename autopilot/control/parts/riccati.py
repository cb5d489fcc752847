"""Gains of a linear feedback: by placed poles, and by the discrete-time LQR."""

import numpy as np

from colibri.common.jit import compiled, compiled_for
from colibri.common.matrices import add, inverse, matmul, solve
from colibri.common.types import Array

_DOUBLINGS = 40
_RESIDUE = 1e-15  # converged if a doubling adds less than this part of the cost matrix


@compiled
def _largest(A: Array) -> float:
    largest = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            largest = max(largest, abs(A[i, j]))
    return largest


@compiled_for("Tuple((float64[:, ::1], float64[:, ::1]))(" + ", ".join(["float64[:, :]"] * 4) + ")")
def lqr(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Return cost S, (n, n), and gain K, (m, n), of u = -K x for x[k+1] = A x[k] + B u[k].

    By doubling of the Riccati equation: Chu, Fan, Lin and Wang, Int. J. Control 77(8), 2004.
    Requires a stabilisable (A, B), a detectable (Q, A), symmetric Q, (n, n), and positive definite R, (m, m).
    """
    eye = np.eye(A.shape[0])
    F, G, S = A.copy(), matmul(matmul(B, inverse(R)), B.T), Q.copy()
    for _ in range(_DOUBLINGS):
        W = inverse(add(eye, matmul(G, S)))
        step = matmul(F.T, matmul(S, matmul(W, F)))
        F, G, S = matmul(F, matmul(W, F)), add(G, matmul(F, matmul(W, matmul(G, F.T)))), add(S, step)
        if _largest(step) <= _RESIDUE * _largest(S):
            break
    weighted = matmul(B.T, S)
    return S, solve(add(R, matmul(weighted, B)), matmul(weighted, A))


def gains(poles: tuple[float, float]) -> tuple[float, float]:
    """Return the gains on an error, 1/s², and on its rate, 1/s, for two poles, 1/s."""
    first, second = poles
    return first * second, -(first + second)
