import pickle
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.autopilot.control.profile import profile_text
from colibri.campaigns.factors import CampaignError
from colibri.campaigns.flights import Verdict, check, common_of, fly_point
from tests.support.campaigns import MASS, SHORT, Hovers, flown, planned
from tests.support.refusals import refusal_of


class Falls(Hovers):
    def step(self, _memory: None, time_us: int, state: colibri.VehicleState, _references: object) -> Any:
        if time_us > 50_000 and self.raises:
            raise ZeroDivisionError("by zero")
        return None, colibri.Decision(0.0 * self._speeds, state.euler)

    def __init__(self, table: dict[str, float], vehicle: colibri.Vehicle, clock: object) -> None:
        super().__init__(table, vehicle, clock)
        self.raises = bool(table.get("raises"))


def test_it_is_the_flight_of_the_same_options() -> None:
    (row,) = flown(seeds=3, fly=SHORT | {"turbulence": "light"}, metrics=["rmse_m", "qp_failures", "rmse_after_20s_m"])
    flight = colibri.fly("hover", seed=3, turbulence="light", **SHORT)
    assert row.verdict is Verdict.FLOWN
    assert (row.sha256, row.metrics) == (flight.sha256, (flight.report["rmse_m"], 0.0, None))
    assert not row.files


def test_numbers_of_files_are_changed_by_their_keys() -> None:
    vehicle = colibri.load_vehicle("hummingbird")
    heavier = colibri.fly("hover", plant_vehicle=vehicle.replace("body.mass_kg", 1.1 * vehicle.body.mass_kg), **SHORT)
    for key, value in ((MASS, 1.1 * vehicle.body.mass_kg), (f"{MASS}*", 1.1)):
        (row,) = flown(grid={"track": ["hover"], key: [value]})
        assert row.sha256 == heavier.sha256
    (both,) = flown(grid={"track": ["hover"], "vehicle.body.mass_kg*": [1.1]})
    assert both.sha256 not in (heavier.sha256, colibri.fly("hover", **SHORT).sha256)


def test_a_key_multiplies_each_of_several_numbers_or_one() -> None:
    vehicle = colibri.load_vehicle("hummingbird")
    inertia = [1.2 * each for each in vehicle.body.inertia_kg_m2]
    weak = vehicle.replace("body.inertia_kg_m2", inertia).replace("rotors.strength.0", 0.9)
    keys = {"plant-vehicle.body.inertia_kg_m2*": [1.2], "plant-vehicle.rotors.strength.0*": [0.9]}
    (row,) = flown(grid={"track": ["spiral"]} | keys)
    assert row.sha256 == colibri.fly("spiral", plant_vehicle=weak, **SHORT).sha256


def test_nothing_is_read_where_it_is_flown(tmp_path: Path) -> None:
    profile, wind = tmp_path / "own.toml", tmp_path / "wind.csv"
    profile.write_text(profile_text("flight"), encoding="utf-8")
    wind.write_text("t,east,north,up\n0,1,2,0\n9,2,1,0\n", encoding="utf-8")
    points = tmp_path / "points.csv"
    points.write_text("t,x,y,z\n0,0,0,2\n5,1,0,2\n", encoding="utf-8")
    fly = {"duration": 0.2, "profile": str(profile), "wind": str(wind)}
    track = f"waypoints:{points}"
    expected = colibri.fly(track, **fly).sha256
    campaign = planned(fly=fly, grid={"track": [track]})
    common = common_of(campaign)
    for file in (profile, wind, points):
        file.unlink()
    assert fly_point(pickle.loads(pickle.dumps(common)), next(campaign.points())).sha256 == expected


def test_a_lost_flight_says_why_and_keeps_its_logs() -> None:
    fly = {"duration": 1.0, "start": {"z": 2.0}, "controller": Falls}
    (row,) = flown(fly=fly, logs="lost")
    assert row.verdict is Verdict.LOST
    assert "on the ground" in row.why
    kept = {"flight.csv", "flight.ulg", "report.json", "provenance.json"}
    assert {f"flights/000000/{name}" for name in kept} <= row.files.keys()
    (unkept,) = flown(fly=fly)
    assert unkept == row._replace(files={})


def test_a_law_that_raises_is_a_row_with_its_traceback() -> None:
    profile = colibri.load_profile("flight").replace("controllers.Falls", {"raises": 1.0})
    (row,) = flown(fly=SHORT | {"controller": Falls, "profile": profile}, metrics=["rmse_m", "lost_at_s"])
    assert row.verdict is Verdict.FAILED
    assert row.why == (
        "controller Falls raised at t = 0.060 s: ZeroDivisionError: by zero; its traceback is in "
        "flights/000000/failure.txt"
    )
    assert row.metrics[1] == 0.06
    ((name, text),) = row.files.items()
    assert name == "flights/000000/failure.txt"
    assert b"ZeroDivisionError" in text
    assert b"/tmp" not in text.splitlines()[0]


def test_what_cannot_be_flown_together_is_a_row() -> None:
    grid = {"track": ["hover"], MASS: [0.7, -1.0]}
    fine, refused = flown(grid=grid, metrics=["rmse_m"])
    assert fine.verdict is Verdict.FLOWN
    assert refused[1:4] == (Verdict.REFUSED, "body.mass_kg: Expected `float` > 0.0", (None,))


@pytest.mark.long
def test_keys_are_changed_over_udp_too() -> None:
    tables: list[dict[str, Any]] = [{"link": link, "duration": 0.2} for link in ("udp", "memory")]
    udp, memory = (flown(fly=fly, grid={"track": ["hover"], MASS: [0.6]}) for fly in tables)
    assert [row.sha256 for row in udp] == [row.sha256 for row in memory]


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"grid": {"track": ["hover"], "profile": ["fligt"]}}, 'unknown profile "fligt" (did you mean "flight"?)'),
        ({"grid": {"track": ["hover", "hovr"]}}, "hovr"),
        ({"grid": {"track": ["hover"], "plant-vehicle.body.mas_kg": [1.0]}}, 'did you mean "mass_kg"?)'),
        ({"grid": {"track": ["hover"], "controllers.lpv-mpc.weights.rat": [1.0]}}, 'did you mean "rate"?)'),
        ({"draw": {MASS: {"normal": [0.7, 0.8]}}}, "Expected `float` > 0.0"),
        ({"grid": {"track": ["hover"], "profile.references*": [2.0]}}, "leave the * out"),
        ({"fly": {"duration": -1.0}}, "duration: must be a number above 0 s"),
    ],
)
def test_what_can_never_be_flown_is_refused_beforehand(tables: dict[str, Any], said: str) -> None:
    campaign = planned(**tables)
    assert said in refusal_of(lambda: check(campaign.samples(), common_of(campaign)))


def test_a_metric_that_is_not_finite_is_none() -> None:
    (row,) = flown(metrics={"nan": lambda _: nan, "inf": lambda _: inf})
    assert row.metrics == (None, None)


def test_a_metric_that_raises_ends_the_campaign_in_one_line() -> None:
    def broken(_flight: colibri.Flight) -> float:
        raise KeyError("z")

    with pytest.raises(CampaignError, match="metric broken raised KeyError: 'z'"):
        flown(metrics=[broken])
