"""The golden flights, on this computer and on others as far as it can pass for them, are the same to the last bit."""

from pathlib import Path

import pytest

from colibri.cli.main import main
from colibri.verification.golden_flights import FLIGHTS
from tests.support.recorded import begins_as_recorded
from tools.golden import GoldenHashes, Variation, fly, variations
from tools.golden import main as golden_main

FEW = ("at-its-limits-in-gusts", "lemniscate-on-sensors", "wave-by-global-lpv-mpc", "crown", "tumbling-by-se3")
"""Those that showed a difference of kernels first, and others of other parts."""
ALL = {variation.name: variation for variation in variations()}


def check(variation: Variation, flown: GoldenHashes) -> None:
    differing = [
        f"{flight}: expected {expected[:16]}, found {found[:16] or 'none: it did not end'}"
        for flight, (expected, found) in flown.differing().items()
    ]
    assert not differing, f"not the golden flights, {variation.name}, {flown.took_s:.0f} s:\n" + "\n".join(differing)


def fly_here(variation: Variation, tmp_path: Path, link: str = "memory", only: tuple[str, ...] = ()) -> GoldenHashes:
    obstacle = variation.obstacle()
    if obstacle:
        pytest.skip(f"{variation.name}: {obstacle}")
    return fly(variation, tmp_path, link, only)


@pytest.mark.long
@begins_as_recorded
def test_a_few_golden_flights_are_what_they_were(tmp_path: Path) -> None:
    only = [f"--only={name}" for name in FEW]
    assert main(["verify", "--golden", "--link", "memory", "--out", str(tmp_path), "--quiet", *only]) == 0


@begins_as_recorded
@pytest.mark.long
@pytest.mark.parametrize("name", ALL)
def test_every_golden_flight_is_the_same_under_every_variation(tmp_path: Path, name: str) -> None:
    flown = fly_here(ALL[name], tmp_path)
    assert list(flown.hashes) == [flight.name for flight in FLIGHTS]
    check(ALL[name], flown)


@begins_as_recorded
@pytest.mark.long
@pytest.mark.parametrize("name", ["as-it-is", "openblas-haswell"])
def test_every_golden_flight_is_the_same_over_udp(tmp_path: Path, name: str) -> None:
    check(ALL[name], fly_here(ALL[name], tmp_path, "udp"))


def test_what_the_cpu_cannot_do_is_not_flown_and_says_why() -> None:
    assert Variation(name="future", needs=("avx2048",)).obstacle() == "this CPU has no avx2048"
    assert Variation(name="elsewhere", lacks="not here").obstacle() == "not here"
    assert not Variation(name="here").obstacle()


def test_an_unknown_variation_is_refused_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        golden_main(["--variation", "abacus"])
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert '--variation: unknown variation "abacus" (choose as-it-is, openblas-nehalem' in error
    assert error.count("\n") == 1
