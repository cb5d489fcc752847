"""Semidefinite programs, Lyapunov functions and their check: small loops whose answers are known."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from colibri.certification import certificate, lyapunov
from colibri.certification.loop import UncertainLoop, supply
from colibri.certification.lyapunov import Inequality, minimise
from colibri.common.types import Array


def scalar(*poles: float, gain: float = 0.0, disturbance: float = 0.1) -> UncertainLoop:
    """Return z' = a z + w, a anywhere between the poles, ±`gain` of |z| unsure, |z| limited to 1."""
    one = np.ones((1, 1))
    return UncertainLoop(
        vertices=np.array(poles).reshape(-1, 1, 1),
        entries=one,
        channels=one,
        gains=one * gain,
        offsets=np.zeros(1),
        disturbance=one * disturbance,
        limits=one,
        starts=one,
        stage=one,
        mirrors=np.ones((1, 1), dtype=int),
    ).reduced()


def in_fractions(loop: UncertainLoop) -> UncertainLoop:
    fractions = {
        name: np.vectorize(certificate.exactly, otypes=[object])(each)
        for name, each in loop._asdict().items()
        if each.size
    }
    return loop._replace(**fractions | {"mirrors": loop.mirrors})


def test_the_least_eigenvalue_is_found() -> None:
    A = np.array([[2.0, 1.0], [1.0, 3.0]])
    x = minimise(np.array([-1.0]), [Inequality(A, -np.eye(2)[None])])
    assert x == pytest.approx([np.linalg.eigvalsh(A)[0]], rel=1e-6)


def test_of_many_inequalities_all_are_kept() -> None:
    constants = np.arange(1.0, 60.0)[::-1].reshape(-1, 1, 1)
    x = minimise(np.array([-1.0]), [], Inequality(constants, -np.ones((59, 1, 1, 1))))
    assert x == pytest.approx([1.0], abs=1e-6)


def test_what_cannot_be_is_none() -> None:
    assert minimise(np.zeros(1), [Inequality(-np.eye(1), np.zeros((1, 1, 1)))]) is None


@pytest.mark.parametrize(
    ("poles", "gain", "stable"), [((0.9,), 0.05, True), ((0.9,), 0.2, False), ((-0.5, 1.1), 0, False)]
)
def test_a_loop_contracts_if_poles_stay_in_the_unit_circle(poles: tuple[float, ...], gain: float, stable: bool) -> None:
    assert (lyapunov.contraction(scalar(*poles, gain=gain), 1.0) is not None) == stable


def test_the_fastest_decay_is_that_of_the_slowest_pole() -> None:
    proof = lyapunov.fastest(scalar(0.5, 0.9))
    assert proof
    assert proof.ratio == pytest.approx(0.81, abs=0.01)


def test_the_attractor_bound_is_tight() -> None:
    proof = lyapunov.attractor(scalar(0.9))
    assert proof
    least = 0.1 / (1.0 - 0.9)
    assert least < proof.reach(np.eye(1))[0] < 1.2 * least


def test_the_set_reaches_the_limits_and_no_further() -> None:
    proof = lyapunov.invariant_set(scalar(0.8))
    assert proof
    assert proof.reach(np.eye(1))[0] == pytest.approx(1.0, rel=1e-3)
    assert lyapunov.invariant_set(scalar(0.8, disturbance=0.3)) is None


def test_the_terminal_weight_is_the_cost_to_go() -> None:
    proof = lyapunov.terminal_weight(scalar(0.8))
    assert proof
    assert proof.P[0, 0] == pytest.approx(1.0 / (1.0 - 0.64), rel=1e-3)


def test_a_proof_is_confirmed_and_one_that_is_spoilt_is_not() -> None:
    loop = scalar(0.5, 0.8, gain=0.02, disturbance=0.1)
    proof = lyapunov.invariant_set(loop)
    assert proof
    fractions = in_fractions(loop)
    assert certificate.decrease_margin(fractions, proof) > 0.0
    assert certificate.supply_margin(fractions, proof) > 0.0
    assert certificate.limit_margin(fractions, proof) > 0.0
    assert certificate.limit_margin(fractions, proof._replace(P=0.9 * proof.P)) == 0.0
    assert certificate.decrease_margin(fractions, proof._replace(ratio=0.6)) == 0.0
    assert certificate.decrease_margin(fractions, proof._replace(multipliers=-proof.multipliers)) == 0.0
    assert certificate.supply_margin(fractions, proof._replace(ratio=1.0)) < 0.0


@pytest.mark.parametrize(("beside", "positive"), [("0.999999999999", True), ("1", False), ("1.000000000001", False)])
def test_what_is_positive_definite_is_decided_exactly(beside: str, positive: bool) -> None:
    off = Fraction(beside)
    M = np.array([[Fraction(1), off], [off, Fraction(1)]], dtype=object)
    assert certificate.is_positive(M) == positive


def test_decimals_are_taken_as_they_are_written() -> None:
    assert certificate.exactly(0.1) == Fraction(1, 10)


def test_the_quadratic_bound_holds_wherever_the_linear_one_does() -> None:
    rng = np.random.default_rng(3)
    loop: Any = scalar(0.5)._replace(
        channels=rng.normal(size=(4, 5)), gains=rng.uniform(size=(3, 4)), offsets=rng.uniform(size=3)
    )
    bound = supply(loop, rng.uniform(0.1, 1.0, 4))
    for _ in range(100):
        z: Array = rng.normal(size=5)
        linear = loop.gains @ np.abs(loop.channels @ z) + loop.offsets
        assert (linear**2 <= np.einsum("i,mij,j->m", z, bound.forms, z) + bound.constants + 1e-12).all()
