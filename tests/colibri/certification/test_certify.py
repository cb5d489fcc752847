"""`colibri certify`: what is certified of profile flight, the flights that may not leave it, and what is refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile, profile_text
from colibri.certification import certificate as certificates
from colibri.certification.attitude import AttitudeNumbers
from colibri.certification.certificate import Certificate
from colibri.certification.flights import Interval, integrate
from colibri.certification.lqr_attitude import Conditions, LqrAttitude
from colibri.certification.lyapunov import Proof, spectral_radius
from colibri.certification.report import CERTIFICATE, FIGURE, attitudes_held, fly_from
from colibri.cli.main import main
from colibri.plant.vehicle.description import load_vehicle

HERE = Path(__file__).parent
CONDITIONS = Conditions(0.01, 0.5)
FLIGHT = LqrAttitude(load_profile("flight"), load_vehicle("hummingbird"), CONDITIONS)
REFUSED = 0.6
"""Part of the ranges of the unstable profile: 52.8 degrees."""
FLIGHTS = 1000


@pytest.fixture(scope="module")
def certified() -> Certificate:
    """Return the certificate of profile flight that `colibri certify flight` wrote."""
    return certificates.read(HERE / "flight.json", AttitudeNumbers)


def test_the_certificate_is_of_what_flies(certified: Certificate) -> None:
    for entry in certified:
        assert entry.numbers == FLIGHT.numbers_at(entry.scale)


def test_the_certificate_is_confirmed_in_exact_arithmetic(certified: Certificate) -> None:
    _, numbers, proof, margins = certified.invariant
    assert certificates.margins_of(FLIGHT, "invariant", numbers, proof) == pytest.approx(margins, rel=0.01)
    assert min(margins.values()) > 0.0


def spoilt(proof: Proof, i: int, j: int, factor: float) -> Proof:
    """Return the proof with one entry of P multiplied."""
    P = proof.P.copy()
    P[i, j] *= factor
    return proof._replace(P=P)


@pytest.mark.parametrize(
    ("what", "spoil"),
    [
        ("decrease", lambda proof: spoilt(proof, 1, 1, 1.1)),
        ("decrease", lambda proof: spoilt(proof, 0, 1, 1.0 + 1e-12)),
        ("disturbance", lambda proof: proof._replace(multipliers=1.001 * proof.multipliers)),
        ("limits", lambda proof: proof._replace(P=0.999 * proof.P)),
    ],
    ids=["P unlike", "P not symmetric", "larger multipliers", "larger set"],
)
def test_a_certificate_that_was_tampered_with_is_not_confirmed(
    certified: Certificate, what: str, spoil: Callable[[Proof], Proof]
) -> None:
    _, numbers, proof, _ = certified.invariant
    assert certificates.margins_of(FLIGHT, "invariant", numbers, spoil(proof))[what] <= 0.0


def test_a_certificate_of_a_weaker_gain_is_not_confirmed(certified: Certificate) -> None:
    _, numbers, proof, _ = certified.invariant
    weaker = numbers._replace(gain=(0.8 * np.array(numbers.gain)).tolist())
    assert certificates.margins_of(FLIGHT, "invariant", weaker, proof)["decrease"] == 0.0


@pytest.mark.long
@pytest.mark.parametrize("name", Certificate._fields)
def test_every_part_of_it_is_confirmed(certified: Certificate, name: str) -> None:
    _, numbers, proof, _ = getattr(certified, name)
    assert min(certificates.margins_of(FLIGHT, name, numbers, proof).values()) > 0.0


def test_of_a_thousand_flights_from_its_border_none_leaves_it(certified: Certificate) -> None:
    flown = fly_from(certified, FLIGHTS, seed=1)
    assert flown.values.shape[1] == FLIGHTS
    assert flown.values[0] == pytest.approx(np.ones(FLIGHTS))
    assert flown.values.max() <= 1.0


def test_flights_tend_to_what_is_certified_at_least_as_fast(certified: Certificate) -> None:
    states, proof = fly_from(certified, 100, seed=2).states, certified.attractor.proof
    values = np.einsum("tfi,ij,tfj->tf", states, proof.P, states)
    assert (values[1:] <= proof.ratio * values[:-1] + 1.0 - proof.ratio + 1e-9).all()


def test_the_set_holds_attitudes_within_the_profile(certified: Certificate) -> None:
    assert (np.degrees(attitudes_held(certified)) > 5.0).all()
    assert certified.largest.scale > 0.6


def test_beyond_the_largest_ranges_the_law_is_soon_unstable_indeed() -> None:
    """So whatever kind of Lyapunov function were tried, it could not reach much further."""
    assert spectral_radius(FLIGHT.loop(FLIGHT.numbers_at(0.66), float)) < 1.0
    assert spectral_radius(FLIGHT.loop(FLIGHT.numbers_at(0.69), float)) > 1.0


@pytest.fixture
def unstable(tmp_path: Path) -> str:
    """Return profile flight made unstable: it may tilt further than its gain, that of hover, is stable."""
    text, made = profile_text("flight"), tmp_path / "unstable.toml"
    assert text.count("max_angle_deg = 70.0") == 1
    made.write_text(text.replace("max_angle_deg = 70.0", "max_angle_deg = 88.0"), encoding="utf-8")
    return str(made)


def test_a_profile_that_is_unstable_is_refused(
    unstable: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["certify", unstable, "--least", str(REFUSED), "--out", str(tmp_path), "--quiet"])
    assert end.value.code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "refused" in line
    assert "unstable by itself" in line
    assert not (tmp_path / CERTIFICATE).exists()


@pytest.mark.parametrize(("scale", "grows"), [(0.5, False), (REFUSED, True)])
def test_what_is_refused_is_unstable_indeed(unstable: str, scale: float, grows: bool) -> None:
    """An error far too small for what is not linear, where phi and theta are at the ends of their ranges."""
    numbers = LqrAttitude(load_profile(unstable), load_vehicle("hummingbird"), CONDITIONS).numbers_at(scale)
    z, nothing, gain = np.full((1, 12), 1e-9), np.zeros((1, 3)), np.array(numbers.gain)
    held = 2.0 * np.arctan([numbers.half_tangents])
    for _ in range(2000):
        commands = z[:, 9:] - z @ gain.T
        interval = Interval(commands, nothing, held, np.zeros(1), np.array(numbers.inertia_kg_m2), numbers.lag_s)
        z = np.hstack([integrate(z[:, :9], interval, numbers.interval_s), commands])
    assert bool(abs(z).max() > 1e-6) == grows


def test_another_law_is_not_certified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["certify", "path", "--out", str(tmp_path)])
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "path: has no numbers for lpv-mpc: only that law can be certified" in line


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nonsense"], "nonsense"),
        (["thesis"], "has no numbers for lpv-mpc"),
        (["flight", "--vehicle", "nonsense"], "nonsense"),
        (["flight", "--charge", "1.5"], "part of 1"),
        (["flight", "--moment", "0"], "above zero"),
    ],
)
def test_bad_input_is_told(arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["certify", *arguments, "--out", str(tmp_path)])
    assert end.value.code == 2
    assert told in capsys.readouterr().err


@pytest.mark.long
def test_profile_flight_is_certified(tmp_path: Path, certified: Certificate) -> None:
    assert main(["certify", "flight", "--out", str(tmp_path), "--quiet"]) == 0
    again = certificates.read(tmp_path / CERTIFICATE, AttitudeNumbers)
    assert again.largest.scale == pytest.approx(certified.largest.scale, abs=0.02)
    for name in ("invariant", "attractor"):
        then, now = (getattr(each, name).proof.reach(np.eye(12)) for each in (certified, again))
        assert now == pytest.approx(then, rel=0.05)
    assert (tmp_path / FIGURE).stat().st_size > 10_000
