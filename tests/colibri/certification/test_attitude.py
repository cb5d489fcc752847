"""The uncertain loop of the attitude: whatever the nonlinear plant does in an interval lies within it."""

from fractions import Fraction
from math import exp

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.certification.attitude import AttitudeNumbers, CertifiedConditions, attitude_loop, box_of
from colibri.certification.certificate import exactly
from colibri.certification.loop import RangeError, UncertainLoop
from colibri.certification.planned_attitude import PlannedAttitude
from colibri.certification.report import Interval, integrate
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle

PROFILE, VEHICLE, CONDITIONS = load_profile("flight"), load_vehicle("hummingbird"), CertifiedConditions(0.01, 0.5)
LAW = PlannedAttitude(PROFILE.table("lpv-mpc"), VEHICLE, CONDITIONS)
INERTIA = [0.003, 0.004, 0.006]
UNEQUAL = LAW.numbers_at(0.5)._replace(inertia_kg_m2=INERTIA)
MARGIN = 1.0 + 1e-9


def directions(rng: np.random.Generator, numbers: AttitudeNumbers) -> tuple[Array, Array]:
    """Return a direction in which to look at a matrix, (3, 3), and its largest component at each vertex."""
    side = rng.normal(size=(3, 3))
    return side, np.einsum("ij,vij->v", side, box_of(AttitudeNumbers(*map(np.array, numbers))).kinematic)


def test_the_error_hull_covers_the_error_box() -> None:
    rng = np.random.default_rng(1)
    for _ in range(500):
        error = rng.uniform(-1.0, 1.0, 3) * UNEQUAL.angles[:3]
        eta = np.sqrt(1.0 - 0.25 * error @ error)
        T = np.array([eta * rate + 0.5 * np.cross(error, rate) for rate in np.eye(3)]).T
        side, vertices = directions(rng, UNEQUAL)
        assert np.sum(side * T) <= vertices.max() + 1e-12


@pytest.mark.parametrize("numbers", [LAW.numbers_at(0.5), UNEQUAL], ids=["as it is", "unequal"])
def test_what_the_plant_does_in_an_interval_lies_within_the_loop(numbers: AttitudeNumbers) -> None:
    loop, rng, flights = attitude_loop(numbers, float), np.random.default_rng(2), 400
    z, interval = somewhere(numbers, rng, flights)
    remembered = z @ np.array(numbers.commanded[1]).T
    after = np.hstack([integrate(z[:, :9], interval, numbers.interval_s), remembered])
    sides = rng.normal(size=(flights, 12)) / np.abs(after).max(axis=0)
    assert (np.sum(sides * after, axis=1) <= supports(loop, z, sides) * MARGIN).all()


def somewhere(numbers: AttitudeNumbers, rng: np.random.Generator, flights: int) -> tuple[Array, Interval]:
    rates = np.array(numbers.rates_rad_s)
    z = np.zeros((flights, 12))
    z[:, [0, 2, 4]] = rng.uniform(-0.8, 0.8, (flights, 3)) * numbers.angles[:3]
    z[:, [1, 3, 5]] = rng.uniform(-0.8, 0.8, (flights, 3)) * rates
    z[:, 6:] = rng.uniform(-0.02, 0.02, (flights, 6))
    disturbance = rng.normal(size=(flights, 3))
    disturbance *= numbers.disturbance_n_m / np.linalg.norm(disturbance, axis=1)[:, None]
    commands = z @ np.array(numbers.commanded[0]).T
    momentum = LAW.momentum(rng.uniform(*LAW.thrusts_n(0.5), flights))
    return z, Interval(commands, disturbance, np.array(numbers.inertia_kg_m2), numbers.lag_s, momentum)


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


def test_symmetry_leaves_a_quarter_of_the_vertices() -> None:
    loop = attitude_loop(UNEQUAL, float)
    assert len(loop.vertices) == 4 * len(loop.distinct().vertices) == 128
    assert loop.blocks() == [[0, 1, 6, 9], [2, 3, 7, 10], [4, 5, 8, 11]]


def test_the_moments_follow_as_their_lag_has_it() -> None:
    numbers = LAW.numbers_at(0.3)
    A = attitude_loop(numbers, float).vertices[0]
    assert numbers.stays == pytest.approx(exp(-0.008 / 0.025))
    assert A[6, 6] == pytest.approx(numbers.stays + (1.0 - numbers.stays) * numbers.commanded[0][0][6])


def test_ranges_that_an_interval_leaves_are_refused() -> None:
    with pytest.raises(RangeError, match="within one control interval"):
        attitude_loop(LAW.numbers_at(0.3)._replace(interval_s=0.1), float)
    with pytest.raises(RangeError, match="no moments remain"):
        attitude_loop(LAW.numbers_at(0.3)._replace(headroom=0.0), float)


def test_errors_and_gains_that_cannot_be_bounded_are_refused() -> None:
    numbers = LAW.numbers_at(0.3)
    with pytest.raises(RangeError, match="too large together"):
        attitude_loop(numbers._replace(angles=[1.2, 1.2, 1.2, 0.1]), float)
    with pytest.raises(RangeError, match="exceed the rotors"):
        attitude_loop(numbers._replace(unsure=np.ones((2, 3, 12)).tolist()), float)


def test_the_gain_is_that_of_the_laws_own_steps() -> None:
    """A state that is small, held level in hover: what is of second order in it does not count."""
    z = 1e-4 * np.random.default_rng(5).normal(size=12)
    commanded, plan = LAW.decide(z, (0.0, 0.0, 0.0), sum(LAW.thrusts_n(0.0)) / 2.0, None)
    assert commanded == pytest.approx(LAW.commanded @ z, abs=1e-7)
    assert plan.commands.shape == (28, 4)


def test_later_samples_of_the_last_plan_hardly_count() -> None:
    """It moves the nominal motion, about which deviations are linear, but by another integrator."""
    hover_n, level = sum(LAW.thrusts_n(0.0)) / 2.0, (0.0, 0.0, 0.0)
    z = 1e-4 * np.random.default_rng(6).normal(size=12)
    _, plan = LAW.decide(z, level, hover_n, None)
    _, other = LAW.decide(-z, level, hover_n, None)
    mixed = plan._replace(commands=np.vstack([plan.commands[:3], other.commands[3:]]))
    one, two = (LAW.decide(z, level, hover_n, each)[0] for each in (plan, mixed))
    assert np.abs(one - two).max() < 2e-3 * np.abs(one).max()


def test_the_gain_hardly_depends_on_the_attitude() -> None:
    unsure = np.array(LAW.numbers_at(0.43).unsure)
    largest = np.abs(LAW.commanded).max(axis=2)
    assert (unsure.max(axis=2)[:, :2] < 0.02 * largest[:, :2]).all()
