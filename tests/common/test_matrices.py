"""Small matrices: what NumPy and SciPy find, to rounding; whatever the strides."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from colibri.common import matrices
from colibri.common.types import Array

SIZES = st.integers(1, 12)
SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed: int, *shape: int) -> Array:
    return np.random.default_rng(seed).standard_normal(shape)


@given(SEEDS, SIZES, SIZES, SIZES)
def test_products(seed: int, n: int, k: int, m: int) -> None:
    A, B = drawn(seed, n, k), drawn(seed + 1, k, m)
    assert matrices.matmul(A, B) == pytest.approx(A @ B, abs=1e-12)
    assert matrices.matmul(B.T, A.T) == pytest.approx((A @ B).T, abs=1e-12)
    assert matrices.matvec(A, B[:, 0]) == pytest.approx(A @ B[:, 0], abs=1e-12)
    assert matrices.dot(A[0], B[:, 0]) == pytest.approx(A[0] @ B[:, 0], abs=1e-12)
    assert matrices.norm(A[:, 0]) == pytest.approx(np.linalg.norm(A[:, 0]))


@given(SEEDS, SIZES, SIZES)
def test_what_is_solved_solves(seed: int, n: int, m: int) -> None:
    A, X = drawn(seed, n, n) + 2.0 * np.sqrt(n) * np.eye(n)[:, ::-1], drawn(seed + 1, n, m)
    assert matrices.solve(A, A @ X) == pytest.approx(X, abs=1e-10)
    assert matrices.inverse(A) @ A == pytest.approx(np.eye(n), abs=1e-10)


def test_four_rows_are_added_one_after_another() -> None:
    random = np.random.default_rng(0)
    to, rows, (a, b, c, d) = random.normal(size=21), random.normal(size=(4, 21)), random.normal(size=4).tolist()
    expected = to.copy()
    for factor, row in zip((a, b, c, d), rows, strict=True):
        expected[5:18] += factor * row[5:18]
    matrices.add_four(to, rows, (a, b, c, d), 5, 18)
    assert to.tobytes() == expected.tobytes()


def test_a_singular_matrix_has_no_finite_inverse() -> None:
    assert not np.isfinite(matrices.inverse(np.ones((2, 2)))).all()


@given(SEEDS, st.integers(1, 8), st.floats(0.0, 30.0))
def test_exponentials(seed: int, n: int, size: float) -> None:
    A = size * drawn(seed, n, n) / n
    expected = linalg.expm(A)
    assert np.abs(matrices.expm(A) - expected).max() <= 1e-11 * np.abs(expected).max()


def test_the_exponential_of_what_is_not_finite_ends() -> None:
    assert not np.isfinite(matrices.expm(np.full((2, 2), np.inf))).all()
