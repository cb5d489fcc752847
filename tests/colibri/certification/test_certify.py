"""`colibri certify`: what is certified of profile flight, the flights that may not leave it, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile, profile_text
from colibri.certification import certificate as certificates
from colibri.certification.attitude import AttitudeNumbers
from colibri.certification.certificate import Certificate
from colibri.certification.lqr_attitude import Conditions, LqrAttitude
from colibri.certification.lyapunov import spectral_radius
from colibri.certification.report import CERTIFICATE, FIGURE, attitudes_held, fly_from
from colibri.cli.main import main
from colibri.plant.vehicle.description import load_vehicle

HERE = Path(__file__).parent
FLIGHT = LqrAttitude(load_profile("flight"), load_vehicle("hummingbird"), Conditions(0.01, 0.5))
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
    spoilt = proof._replace(ratio=0.9)
    assert certificates.margins_of(FLIGHT, "attractor", numbers, spoilt)["decrease"] == 0.0


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
    """Return profile flight made unstable: next to nothing is done about pitch, and hardly any tilt is too much."""
    text, made = profile_text("flight"), tmp_path / "unstable.toml"
    for key, was, value in (
        ("output_weight", "[1.0, 1.0, 0.1]", "[1.0, 1e-6, 1e-2]"),
        ("max_angle_deg", "70.0", "88.0"),
    ):
        assert text.count(f"{key} = {was}") == 1
        text = text.replace(f"{key} = {was}", f"{key} = {value}")
    made.write_text(text, encoding="utf-8")
    return str(made)


def test_a_profile_that_is_unstable_is_refused(
    unstable: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["certify", unstable, "--out", str(tmp_path), "--quiet"])
    assert end.value.code == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "refused" in line
    assert "unstable by itself" in line
    assert not (tmp_path / CERTIFICATE).exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nonsense"], "nonsense"),
        (["thesis"], "cannot be certified"),
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
