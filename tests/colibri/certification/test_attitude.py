"""The uncertain loop of the attitude: whatever the nonlinear plant does in an interval lies within it."""

from fractions import Fraction
from math import exp

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.certification.attitude import AttitudeNumbers, attitude_loop, box_of
from colibri.certification.exact import exactly
from colibri.certification.flights import Interval, integrate
from colibri.certification.loop import RangeError, UncertainLoop
from colibri.certification.lqr_attitude import Conditions, LqrAttitude
from colibri.common.rotations import euler_rates
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle

LAW = LqrAttitude(load_profile("flight"), load_vehicle("hummingbird"), Conditions(0.01, 0.5))
UNEQUAL = LAW.numbers_at(0.6)._replace(inertia_kg_m2=[0.003, 0.004, 0.006])
MARGIN = 1.0 + 1e-9


def arrays(numbers: AttitudeNumbers) -> AttitudeNumbers:
    return AttitudeNumbers(*(np.array(value) for value in numbers))


def test_the_hull_of_the_kinematic_matrix_holds_that_of_every_attitude_in_the_box() -> None:
    box = box_of(arrays(UNEQUAL))
    phi_end, theta_end = 2.0 * np.arctan(UNEQUAL.half_tangents)
    rng = np.random.default_rng(1)
    for _ in range(500):
        phi, theta = rng.uniform(-1.0, 1.0, 2) * (phi_end, theta_end)
        T = np.array([euler_rates(phi, theta, tuple(rate)) for rate in np.eye(3)]).T
        side = rng.normal(size=(3, 3))
        assert np.sum(side * T) <= max(np.sum(side * vertex) for vertex in box.kinematic) + 1e-12


@pytest.mark.parametrize("numbers", [LAW.numbers_at(0.6), UNEQUAL])
def test_what_the_plant_does_in_an_interval_lies_within_the_loop(numbers: AttitudeNumbers) -> None:
    loop, rng, flights = attitude_loop(numbers, float), np.random.default_rng(2), 400
    z, interval = somewhere(numbers, rng, flights)
    after = np.hstack([integrate(z[:, :9], interval, numbers.interval_s), interval.commands])
    sides = rng.normal(size=(flights, 12)) / np.abs(after).max(axis=0)
    assert (np.sum(sides * after, axis=1) <= supports(loop, z, sides) * MARGIN).all()


def somewhere(numbers: AttitudeNumbers, rng: np.random.Generator, flights: int) -> tuple[Array, Interval]:
    """Return states whose rates stay within their ranges, and intervals whose attitudes do."""
    angles, rates = 2.0 * np.arctan(numbers.half_tangents), np.array(numbers.rates_rad_s)
    held = rng.uniform(-0.9, 0.9, (flights, 2)) * angles
    z = np.zeros((flights, 12))
    z[:, [1, 3, 5]] = rng.uniform(-0.8, 0.8, (flights, 3)) * rates
    z[:, 6:] = rng.uniform(-0.02, 0.02, (flights, 6))
    disturbance = rng.normal(size=(flights, 3))
    disturbance *= numbers.disturbance_n_m / np.linalg.norm(disturbance, axis=1)[:, None]
    momentum = rng.uniform(-1.0, 1.0, flights) * numbers.momentum_n_m_s
    commands = z[:, 9:] - z @ np.array(numbers.gain).T
    return z, Interval(commands, disturbance, held, momentum, np.array(numbers.inertia_kg_m2), numbers.lag_s)


def supports(loop: UncertainLoop, z: Array, sides: Array) -> Array:
    """Return the largest value that each side, (f, 12), has over all that the loop may do from its state."""
    moved = np.einsum("vij,fj->fvi", loop.vertices, z)
    largest = np.einsum("fvi,fi->fv", moved, sides).max(axis=1)
    bounds = np.abs(z @ loop.channels.T) @ loop.gains.T + loop.offsets
    disturbed = np.linalg.norm(sides @ loop.disturbance, axis=1)
    total: Array = largest + np.sum(np.abs(sides @ loop.entries) * bounds, axis=1) + disturbed
    return total


def test_fractions_and_floats_make_the_same_loop() -> None:
    floats, fractions = attitude_loop(UNEQUAL, float), attitude_loop(UNEQUAL, exactly)
    for one, other in zip(floats, fractions, strict=True):
        assert np.asarray(other, dtype=float) == pytest.approx(one, rel=1e-12, abs=1e-15)
    assert isinstance(fractions.vertices[0, 0, 0], Fraction)


def test_mirrors_leave_a_quarter_of_the_vertices_and_three_blocks() -> None:
    loop = attitude_loop(UNEQUAL, float)
    assert len(loop.vertices) == 4 * len(loop.distinct().vertices) == 128
    assert loop.blocks() == [[0, 1, 6, 9], [2, 3, 7, 10], [4, 5, 8, 11]]


def test_the_moments_follow_as_their_lag_has_it() -> None:
    numbers = LAW.numbers_at(0.3)
    A = attitude_loop(numbers, float).vertices[0]
    assert numbers.stays == pytest.approx(exp(-0.008 / 0.025))
    assert A[6, 6] == pytest.approx(numbers.stays - (1.0 - numbers.stays) * numbers.gain[0][6])


def test_ranges_that_an_interval_leaves_are_refused() -> None:
    with pytest.raises(RangeError, match="long enough"):
        attitude_loop(LAW.numbers_at(0.3)._replace(interval_s=0.1), float)
    with pytest.raises(RangeError, match="leaves the rotors nothing"):
        attitude_loop(LAW.numbers_at(0.3)._replace(headroom=0.0), float)
