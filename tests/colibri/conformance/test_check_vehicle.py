"""`colibri check-vehicle`: flights of a vehicle file, limits, and how wrong its numbers may be."""

import json
from pathlib import Path

import pytest
from matplotlib.patches import Rectangle

import colibri
from colibri.conformance.subject import Result
from colibri.conformance.vehicle_check import VehicleCheck, check_vehicle
from colibri.conformance.vehicle_figure import draw_tolerances
from colibri.conformance.vehicle_flights import NUMBERS, TRIALS, Bound, Tolerance, bound_of, emptied, fly, has_number
from colibri.plant.vehicle.description import Vehicle
from tests.support.commands import VEHICLE, Ran, Refused, edited

LAW = {"profile": "flight"}
HUMMINGBIRD = colibri.load_vehicle("hummingbird")


def with_thrust(ratio: float) -> Vehicle:
    """Return the Hummingbird, whose battery does not sag, with a mass for this ratio of thrust and weight."""
    vehicle = HUMMINGBIRD.without(["battery"])
    return vehicle.replace("body.mass_kg", float(vehicle.max_wrench()[0]) / vehicle.gravity_m_s2 / ratio)


@pytest.mark.long  # machine code of its own
def test_a_law_of_ten_hertz_flies_on_sensors() -> None:
    assert fly(HUMMINGBIRD, TRIALS["sensors"], {"profile": "thesis"}).error_m < 0.6


@pytest.mark.parametrize("trial", ["lemniscate", "empty battery"])
def test_the_hummingbird_flies(trial: str) -> None:
    flown = fly(HUMMINGBIRD, TRIALS[trial], LAW)
    assert flown.lost == ""
    assert flown.error_m < 0.001


def test_a_vehicle_short_of_thrust_flies_but_carries_nothing() -> None:
    weak = with_thrust(1.08)
    assert fly(weak, TRIALS["hover"], LAW) == ("", 0.0, 0.0)
    assert fly(weak, TRIALS["hover"], {"profile": "se3"}).error_m < 1e-3  # on the track, wherever the profile starts
    assert "is 1.04 times the weight: at least 1.05" in fly(with_thrust(1.0499), TRIALS["hover"], LAW).lost
    assert fly(weak, TRIALS["10 % more mass"], LAW).lost.startswith("refused: rotors.max_speed")


def test_a_heavy_vehicle_tolerates_errors_of_drag_not_of_thrust() -> None:
    heavy = with_thrust(1.3)
    below = bound_of(heavy, "thrust coefficient", 0.25, LAW)
    assert 0.8 < below.factor < 1.0  # at 1.05 / 1.3 the law refuses
    assert below.beyond
    assert bound_of(heavy, "drag", 4.0, LAW) == Bound(4.0, "")


def test_a_bound_beyond_the_range_says_so() -> None:
    assert (str(Bound(4.0, "")), str(Bound(0.25, "")), str(Bound(0.5, "lost: 3 m off"))) == ("≥ 4.00", "≤ 0.25", "0.50")
    assert Tolerance("mass", Bound(0.5, "lost: x"), Bound(1.2, "swings: x")).result is Result.NEAR
    assert Tolerance("mass", Bound(0.5, "lost: x"), Bound(1.3, "swings: x")).result is Result.OK


def test_numbers_of_missing_tables_are_left_out() -> None:
    ideal = HUMMINGBIRD.without(["rotor-lag", "drag"])
    assert [name for name in NUMBERS if not has_number(ideal, name)] == ["rotor lag", "drag"]


def test_an_empty_battery_has_less_thrust() -> None:
    full, empty = HUMMINGBIRD.max_wrench()[0], emptied(HUMMINGBIRD).max_wrench()[0]
    assert empty / full == pytest.approx((9.36 / 12.6) ** 2)


def test_the_figure_has_a_bar_for_each_number() -> None:
    rows = [
        Tolerance("mass", Bound(1.0, "lost: x"), Bound(1.2, "swings: x")),
        Tolerance("drag", Bound(0.25, ""), Bound(4.0, "")),
    ]
    (axes,) = draw_tolerances("mine", rows).axes
    bars = [bar for bar in axes.patches if isinstance(bar, Rectangle)]
    assert [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars] == [(1.0, 1.2), (0.25, 4.0)]
    assert [text.get_text() for text in axes.texts] == ["lost below 1.00", "swings above 1.20", "≤ 0.25", "≥ 4.00"]


def test_a_vehicle_too_heavy_for_its_rotors_is_bad_input(refused: Refused, tmp_path: Path) -> None:
    file = edited(tmp_path, VEHICLE, "mass_kg = 0.698", "mass_kg = 1.55")
    assert "at least 1.05 is required" in refused("check-vehicle", file, "--out", str(tmp_path / "out"))


def test_an_impossible_seed_is_bad_input() -> None:
    with pytest.raises(colibri.Error, match="seed"):
        check_vehicle("hummingbird", seed=-1)


@pytest.mark.long
def test_the_command_flies_draws_and_writes(ran: Ran, tmp_path: Path) -> None:
    said = ran("check-vehicle", "hummingbird", "--json", "--out", str(tmp_path))
    found = json.loads(said.out)
    assert found == json.loads((tmp_path / "check.json").read_text(encoding="utf-8"))
    assert found["passed"]
    assert {each["name"] for each in found["tolerances"]} == set(NUMBERS)
    assert (tmp_path / "tolerances.png").stat().st_size > 10_000


@pytest.mark.long
def test_without_thrust_to_spare_nothing_is_tolerated() -> None:
    checked = check_vehicle(with_thrust(1.06))
    assert isinstance(checked, VehicleCheck)
    assert [each.name for each in checked.failed] == ["step of 4 m", "10 % more mass"]
    assert checked.tolerances == ()
    assert "| 10 % more mass | failed | - |" in str(checked)
