"""Small dense matrices with a fixed order of operations, unlike BLAS; arguments must be writable float64."""

from math import sqrt

import numpy as np

from colibri.common.jit import compiled, compiled_for, noalias
from colibri.common.types import Array

_MATRIX, _VECTOR = "float64[:, :]", "float64[:]"
_NEW_MATRIX, _NEW_VECTOR = "float64[:, ::1]", "float64[::1]"
_TAYLOR_TERMS = 15
_TAYLOR_NORM = 0.5  # larger matrices are halved and squared: 0.5^16 / 16! is far below double precision


@compiled
def put(values: Array, out: Array) -> None:
    """Write `values` into `out`; `out[:] = values` takes seconds to compile, as do sums of arrays."""
    if out.ndim == 1:  # decided before it is compiled
        for i in range(out.shape[0]):
            out[i] = values[i]
    else:
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] = values[i, j]


@noalias
def add_four(to: Array, rows: Array, factors: tuple[float, float, float, float], begin: int, end: int) -> None:
    """Add four rows, (4, n), times factors to the numbers of another, (n,), from `begin` to `end`, one after another.

    Loading and storing a number takes as long as adding one row to it.
    """
    a, b, c, d = factors
    for i in range(begin, end):
        to[i] = to[i] + a * rows[0, i] + b * rows[1, i] + c * rows[2, i] + d * rows[3, i]


@compiled_for(f"{_NEW_MATRIX}({_MATRIX}, {_MATRIX})")
def matmul(A: Array, B: Array) -> Array:
    """Return A B, (n, m), of A (n, k) and B (k, m)."""
    product = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            factor = A[i, k]
            for j in range(B.shape[1]):
                product[i, j] += factor * B[k, j]
    return product


@compiled_for(f"{_NEW_VECTOR}({_MATRIX}, {_VECTOR})")
def matvec(A: Array, x: Array) -> Array:
    """Return A x, (n,), of A (n, k) and x (k,)."""
    product = np.zeros(A.shape[0])
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            product[i] += A[i, k] * x[k]
    return product


@compiled_for(f"{_NEW_MATRIX}({_MATRIX}, {_MATRIX})")
def add(A: Array, B: Array) -> Array:
    """Return A + B, both (n, m)."""
    total = np.empty(A.shape)
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            total[i, j] = A[i, j] + B[i, j]
    return total


@compiled_for(f"float64({_VECTOR}, {_VECTOR})")
def dot(x: Array, y: Array) -> float:
    total = 0.0
    for k in range(x.shape[0]):
        total += x[k] * y[k]
    return total


@compiled_for(f"float64({_VECTOR})")
def norm(x: Array) -> float:
    return sqrt(dot(x, x))


@compiled_for(f"{_NEW_MATRIX}({_MATRIX}, {_MATRIX})")
def solve(A: Array, B: Array) -> Array:
    """Return X of A X = B by elimination with partial pivoting; not finite if A is singular."""
    n, m = B.shape
    U, X = A.copy(), B.copy()
    for column in range(n):
        pivot = column
        for row in range(column + 1, n):
            if abs(U[row, column]) > abs(U[pivot, column]):
                pivot = row
        for j in range(n):
            U[column, j], U[pivot, j] = U[pivot, j], U[column, j]
        for j in range(m):
            X[column, j], X[pivot, j] = X[pivot, j], X[column, j]
        for row in range(column + 1, n):
            factor = U[row, column] / U[column, column]
            if factor != 0.0:
                for j in range(column + 1, n):
                    U[row, j] -= factor * U[column, j]
                for j in range(m):
                    X[row, j] -= factor * X[column, j]
    for row in range(n - 1, -1, -1):
        for j in range(m):
            for k in range(row + 1, n):
                X[row, j] -= U[row, k] * X[k, j]
            X[row, j] /= U[row, row]
    return X


@compiled_for(f"{_NEW_MATRIX}({_MATRIX})")
def inverse(A: Array) -> Array:
    return solve(A, np.eye(A.shape[0]))


@compiled
def _max_column_sum(A: Array) -> float:
    maximum = 0.0
    for j in range(A.shape[1]):
        total = 0.0
        for i in range(A.shape[0]):
            total += abs(A[i, j])
        maximum = max(maximum, total)
    return maximum


@compiled_for(f"{_NEW_MATRIX}({_MATRIX})")
def expm(A: Array) -> Array:
    """Return the exponential of A by scaling and squaring."""
    squarings, size = 0, _max_column_sum(A)
    while _TAYLOR_NORM < size < np.inf:
        size, squarings = 0.5 * size, squarings + 1
    eye, scaled = np.eye(A.shape[0]), A.copy()
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            scaled[i, j] *= 0.5**squarings
    total = eye
    for k in range(_TAYLOR_TERMS, 0, -1):
        product = matmul(scaled, total)
        total = eye.copy()
        for i in range(A.shape[0]):
            for j in range(A.shape[1]):
                total[i, j] += product[i, j] / k
    for _ in range(squarings):
        total = matmul(total, total)
    return total
