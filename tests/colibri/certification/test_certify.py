"""`colibri certify`: what is certified of profile flight, the flights that may not leave it, and what is refused."""

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile, profile_text
from colibri.certification import certificate as certificates
from colibri.certification.attitude import CertifiedConditions, attitude_loop
from colibri.certification.certificate import Certificate, ProofEntry
from colibri.certification.loop import UncertainLoop
from colibri.certification.lyapunov import Proof
from colibri.certification.planned_attitude import HELD_RAD, PlanFlyer, PlannedAttitude
from colibri.certification.report import CERTIFICATE, FIGURE, Interval, fly, integrate
from colibri.cli.main import main
from colibri.common.types import Array
from colibri.plant.vehicle.description import load_vehicle
from tests.support.certificates import read_certificate
from tests.support.commands import Refused

HERE = Path(__file__).parent
CONDITIONS, VEHICLE = CertifiedConditions(0.01, 0.5), load_vehicle("hummingbird")
PROFILE = load_profile("flight")
FLIGHT = PlannedAttitude(PROFILE.table("lpv-mpc"), VEHICLE, CONDITIONS)
CERTIFIED = read_certificate(HERE / "lpv-mpc.json")  # of profile flight, as `colibri certify` wrote it


def test_the_certificate_is_of_what_flies() -> None:
    for entry in CERTIFIED:
        for one, other in zip(entry.numbers, FLIGHT.numbers_at(entry.scale), strict=True):
            assert np.array(one) == pytest.approx(np.array(other), rel=1e-7, abs=2e-8)


def test_the_certificate_is_confirmed_in_exact_arithmetic() -> None:
    _, numbers, proof, margins = CERTIFIED.invariant
    assert certificates.margins_of("invariant", numbers, proof) == pytest.approx(margins, rel=0.01)
    assert min(margins.values()) > 0.0


@cache
def exact_loop() -> UncertainLoop:
    return attitude_loop(CERTIFIED.invariant.numbers, certificates.exactly)


def spoilt(proof: Proof, i: int, j: int, factor: float) -> Proof:
    P = proof.P.copy()
    P[i, j] *= factor
    return proof._replace(P=P)


@pytest.mark.parametrize(
    ("margin", "spoil"),
    [
        (certificates.decrease_margin, lambda proof: spoilt(proof, 1, 1, 1.1)),
        (certificates.decrease_margin, lambda proof: spoilt(proof, 0, 1, 1.0 + 1e-12)),
        (certificates.supply_margin, lambda proof: proof._replace(multipliers=1.001 * proof.multipliers)),
        (certificates.limit_margin, lambda proof: proof._replace(P=0.999 * proof.P)),
    ],
    ids=["P unlike", "P not symmetric", "larger multipliers", "larger set"],
)
def test_a_certificate_that_was_tampered_with_is_not_confirmed(
    margin: Callable[[UncertainLoop, Proof], float], spoil: Callable[[Proof], Proof]
) -> None:
    assert margin(exact_loop(), spoil(CERTIFIED.invariant.proof)) <= 0.0


@pytest.mark.parametrize(("name", "factor"), [pytest.param("commanded", 0.8, marks=pytest.mark.long), ("unsure", 4.0)])
def test_a_weaker_gain_or_a_lower_bound_is_not_confirmed(name: str, factor: float) -> None:
    _, numbers, proof, _ = CERTIFIED.invariant
    other = numbers._replace(**{name: (factor * np.array(getattr(numbers, name))).tolist()})
    assert certificates.decrease_margin(attitude_loop(other, certificates.exactly), proof) == 0.0


@pytest.mark.long
@pytest.mark.parametrize("part", Certificate._fields)
def test_every_part_of_it_is_confirmed(part: str) -> None:
    _, numbers, proof, _ = getattr(CERTIFIED, part)
    assert min(certificates.margins_of(part, numbers, proof).values()) > 0.0


@pytest.mark.long
def test_flights_from_its_border_stay_and_tend_to_the_attractor() -> None:
    """At least as fast as is certified."""
    flights = 1000
    flown, proof = fly(FLIGHT, CERTIFIED.invariant, flights, 1.0, seed=1), CERTIFIED.attractor.proof
    assert flown.values.shape[1] == flights
    assert flown.values[0] == pytest.approx(np.ones(flights))
    assert flown.values.max() <= 1.0
    values = np.einsum("tfi,ij,tfj->tf", flown.states, proof.P, flown.states)
    assert (values[1:] <= proof.ratio * values[:-1] + 1.0 - proof.ratio + 1e-9).all()


def test_in_the_set_the_law_commands_little_beyond_its_gain() -> None:
    """Of second order in the errors: at half of them a quarter. It is not proven, so it is measured."""
    entry, rng = CERTIFIED.invariant, np.random.default_rng(7)
    border = np.linalg.solve(np.linalg.cholesky(entry.proof.P).T, directions(rng, 300).T).T
    largest = {part: np.abs([beyond(part * z, rng, entry) for z in border]).max(axis=0) for part in (1.0, 0.5)}
    assert (largest[1.0] < 0.1 * np.abs(border @ FLIGHT.commanded[0].T).max(axis=0)[:3]).all()
    assert (largest[0.5] < 0.5 * largest[1.0]).all()


def directions(rng: np.random.Generator, count: int) -> Array:
    normal = rng.normal(size=(count, 12))
    units: Array = normal / np.linalg.norm(normal, axis=1)[:, None]
    return units


def beyond(z: Array, rng: np.random.Generator, entry: ProofEntry) -> Array:
    phi, theta = rng.uniform(-1.0, 1.0, 2) * HELD_RAD
    (commanded, _), _ = FLIGHT.decide(z, (phi, theta, 0.0), rng.uniform(*FLIGHT.thrusts_n(entry.scale)), None)
    more: Array = commanded - FLIGHT.commanded[0] @ z
    return more


def test_the_sets_hold_attitudes_within_the_profile() -> None:
    assert np.radians(5.0) < HELD_RAD
    assert CERTIFIED.largest.scale > 0.85


def made(tmp_path: Path, changes: dict[str, str]) -> str:
    text, path = profile_text("flight"), tmp_path / "unstable.toml"
    for one, other in changes.items():
        assert text.count(one) == 1
        text = text.replace(one, other)
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.fixture
def sluggish(tmp_path: Path) -> str:
    """Return profile flight made unstable: one correction for the whole horizon, which may hardly change."""
    return made(
        tmp_path,
        {"blocks = [1, 2, 3, 5, 7, 10] ": "blocks = [28]", "first_correction = 0.5 ": "first_correction = 100000.0"},
    )


@pytest.mark.long  # its kernels are compiled for it alone
def test_a_profile_that_is_unstable_is_refused(sluggish: str, tmp_path: Path, refused: Refused) -> None:
    said = refused("certify", sluggish, "--out", tmp_path, "--quiet", code=1)
    assert re.search("refused.*unstable by itself", said)
    assert not (tmp_path / CERTIFICATE).exists()


@pytest.mark.long
def test_what_is_refused_is_unstable_indeed(sluggish: str) -> None:
    """By the law's own steps an error of a thousandth grows threefold; with the profile as it is it dies out."""
    unstable = PlannedAttitude(load_profile(sluggish).table("lpv-mpc"), VEHICLE, CONDITIONS)
    assert left_after(unstable, 0.001) > 0.003
    assert left_after(FLIGHT, 0.001) < 0.001


def left_after(law: PlannedAttitude, error: float) -> float:
    """Return the largest error of the attitude after 6 s that began so large about all axes."""
    numbers = law.numbers_at(0.1)
    thrusts_n = np.array(law.thrusts_n(0.1)[:1])
    flyer, momentum = PlanFlyer(law, np.zeros((1, 3)), thrusts_n), law.momentum(thrusts_n)
    z, nothing, inertia = np.zeros((1, 12)), np.zeros((1, 3)), np.array(numbers.inertia_kg_m2)
    z[0, [0, 2, 4]] = error
    for _ in range(750):
        commands, remembered = flyer.commands(z)
        interval = Interval(commands, nothing, inertia, numbers.lag_s, momentum)
        z = np.hstack([integrate(z[:, :9], interval, numbers.interval_s), remembered])
    return float(np.abs(z[0, [0, 2, 4]]).max())


@pytest.mark.long
def test_profile_flight_is_certified(tmp_path: Path) -> None:
    arguments = ["certify", "flight", "--flights", "100", "--out", str(tmp_path), "--quiet"]
    assert main(arguments) == 0
    again = read_certificate(tmp_path / CERTIFICATE)
    assert again.largest.scale == pytest.approx(CERTIFIED.largest.scale, abs=0.02)
    for part in ("invariant", "attractor"):
        then, now = (getattr(each, part).proof.reach(np.eye(12)) for each in (CERTIFIED, again))
        assert now == pytest.approx(then, rel=0.05)
    assert (tmp_path / FIGURE).stat().st_size > 10_000
