"""The Kalman filter's kernels: their Jacobians against differences, invariants of the covariance."""

from math import inf, sqrt

import numpy as np
import pytest

from colibri.autopilot.estimation import eskf_update as update
from colibri.autopilot.estimation.eskf_predict import ERRORS, NOMINAL, SAMPLE, Noise, look_ahead, predict, strap_down
from colibri.common.jit import packed
from colibri.common.types import Array

GRAVITY = 9.81
QUIET = packed(Noise(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0), 60.0, 0.0, 0.0))
FIELD = np.array([0.01, 0.21, -0.43])


def some_state(seed: int) -> Array:
    chance = np.random.default_rng(seed)
    x = chance.normal(size=NOMINAL)
    x[6:10] /= np.linalg.norm(x[6:10])
    x[10:16] *= 0.1
    return x


def some_covariance(seed: int) -> Array:
    root = np.random.default_rng(seed).normal(size=(ERRORS, ERRORS))
    P: Array = root @ root.T * 1e-4
    return P


def product(p: Array, q: Array) -> Array:
    w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.concatenate([[w], v])


def moved(x: Array, error: Array) -> Array:
    y = x.copy()
    y[:6] += error[:6]
    y[10:] += error[9:]
    angle = float(np.linalg.norm(error[6:9]))
    turn = np.concatenate([[np.cos(0.5 * angle)], 0.5 * np.sinc(0.5 * angle / np.pi) * error[6:9]])
    y[6:10] = product(x[6:10], turn)
    return y


def difference(y: Array, x: Array) -> Array:
    turn = product(x[6:10] * np.array([1.0, -1.0, -1.0, -1.0]), y[6:10])
    return np.concatenate([(y - x)[:6], 2.0 * turn[1:] * np.sign(turn[0]), (y - x)[10:]])


def a_sample(seed: int, interval_s: float = 0.004) -> Array:
    sample = np.zeros((1, SAMPLE))
    sample[0, 0] = interval_s
    sample[0, 1:7] = np.random.default_rng(seed).normal(size=6) * [3.0, 3.0, 3.0, 2.0, 2.0, 2.0] + [0, 0, 9.81, 0, 0, 0]
    return sample


@pytest.mark.parametrize("seed", range(5))
def test_transition_is_the_derivative_of_the_strapdown(seed: int) -> None:
    x, sample = some_state(seed), a_sample(seed)
    step = 1e-5
    F = np.empty((ERRORS, ERRORS))
    for j in range(ERRORS):
        ends = []
        for sign in (1.0, -1.0):
            y = moved(x, sign * step * np.eye(ERRORS)[j])
            predict(y, np.zeros((ERRORS, ERRORS)), sample, 0, QUIET, GRAVITY)
            ends.append(y)
        F[:, j] = difference(ends[0], ends[1]) / (2.0 * step)
    P = some_covariance(seed)
    after = P.copy()
    predict(x.copy(), after, sample, 0, QUIET, GRAVITY)
    assert after == pytest.approx(F @ P @ F.T, abs=1e-6 * np.abs(P).max())


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", ["horizontal", "height", "velocity", "pressure", "field", "rest"])
def test_updates_follow_the_derivative_of_the_measurement(kind: str, seed: int) -> None:
    x, P = some_state(seed), some_covariance(seed)
    z = np.random.default_rng(seed + 100).normal(size=3)

    def innovation(state: Array) -> Array:
        y = np.zeros({"horizontal": 2, "height": 1, "pressure": 1, "rest": 6}.get(kind, 3))
        fuse(kind, state.copy(), P.copy(), z, 0.3, y)
        return y

    step = 1e-6
    H = np.column_stack(
        [(innovation(moved(x, -step * e)) - innovation(moved(x, step * e))) / (2.0 * step) for e in np.eye(ERRORS)]
    )
    y = innovation(x)
    noise = 1.0 if kind == "rest" else 0.3
    S = H @ P @ H.T + noise * np.eye(len(y))
    K = P @ H.T @ np.linalg.inv(S)
    after, covariance = x.copy(), P.copy()
    nis = fuse(kind, after, covariance, z, 0.3, np.zeros(len(y)))
    assert nis == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-5)
    error = K @ y
    assert difference(after, x)[:6] == pytest.approx(error[:6], abs=1e-6)
    assert difference(after, x)[9:] == pytest.approx(error[9:], abs=1e-6)
    half = 0.5 * error[6:9]
    reset = np.eye(ERRORS)
    reset[6:9, 6:9] -= np.array([[0, -half[2], half[1]], [half[2], 0, -half[0]], [-half[1], half[0], 0]])
    joseph = np.eye(ERRORS) - K @ H
    expected = reset @ (joseph @ P @ joseph.T + noise * K @ K.T) @ reset.T
    assert covariance == pytest.approx(expected, abs=1e-6 * np.abs(P).max())


def fuse(kind: str, x: Array, P: Array, z: Array, variance: float, y: Array, gate: float = inf) -> float:
    if kind == "horizontal":
        return update.fuse_horizontal(x, P, z, 0.01, variance, gate, y)
    if kind == "height":
        return update.fuse_height(x, P, z, 0.01, variance, gate, y)
    if kind == "velocity":
        return update.fuse_velocity(x, P, z, variance, gate, y)
    if kind == "pressure":
        return update.fuse_pressure_height(x, P, float(z[0]), variance, gate, y)
    if kind == "rest":
        return update.fuse_rest(x, P, z, GRAVITY, variance, 0.1 * z, FIELD, variance, y)
    return update.fuse_field(x, P, z, FIELD, variance, gate, y)


@pytest.mark.parametrize("kind", ["horizontal", "height", "velocity", "pressure", "field"])
def test_what_is_beyond_the_gate_changes_nothing(kind: str) -> None:
    x, P = some_state(1), some_covariance(1)
    before = x.copy(), P.copy()
    y = np.zeros({"horizontal": 2, "height": 1, "pressure": 1, "rest": 6}.get(kind, 3))
    assert fuse(kind, x, P, np.full(3, 1e3), 0.3, y, gate=25.0) > 25.0
    assert fuse(kind, x, P, np.full(3, np.nan), 0.3, y, gate=25.0) == inf
    assert np.array_equal(x, before[0])
    assert np.array_equal(P, before[1])


def test_free_fall_is_a_parabola_and_spin_a_circle() -> None:
    x = np.zeros(NOMINAL)
    x[3:7] = 1.0, 2.0, 3.0, 1.0
    sample = np.zeros((1, SAMPLE))
    sample[0, 0], sample[0, 6] = 0.004, np.pi / 2.0
    for _ in range(250):
        strap_down(x, sample, 0, GRAVITY)
    assert x[:3] == pytest.approx([1.0, 2.0, 3.0 - 0.5 * GRAVITY])
    assert x[3:6] == pytest.approx([1.0, 2.0, 3.0 - GRAVITY])
    assert x[6:10] == pytest.approx([sqrt(0.5), 0.0, 0.0, sqrt(0.5)])


def test_looking_ahead_is_the_filter_itself_without_corrections() -> None:
    x, P = some_state(3), some_covariance(3)
    samples = np.vstack([a_sample(k) for k in range(7)])
    now = np.zeros(19)
    look_ahead(x, P, samples, 5, 6, GRAVITY, now)
    y = x.copy()
    for k in (5, 6, 0, 1, 2, 3):
        predict(y, P.copy(), samples, k, QUIET, GRAVITY)
    assert np.array_equal(now[:10], y[:10])


@pytest.mark.parametrize("interval_s", [0.004, 0.05, 0.9])
def test_a_quick_turn_keeps_its_length(interval_s: float) -> None:
    x = some_state(4)
    strap_down(x, a_sample(4, interval_s) * 5.0, 0, GRAVITY)
    assert np.linalg.norm(x[6:10]) == pytest.approx(1.0, abs=1e-14)


def test_unknown_force_and_rate_widen_the_covariance() -> None:
    x, P, sample = some_state(5), some_covariance(5), a_sample(5)
    sample[0, 7:9] = 1.0
    y, wide = x.copy(), P.copy()
    predict(y, wide, sample, 0, QUIET, GRAVITY)
    assert y[3:10] == pytest.approx(x[3:10], abs=1e-12)
    assert (np.diag(wide)[3:9] > np.diag(P)[3:9]).all()
