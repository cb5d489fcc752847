from itertools import product
from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.campaigns.definition import CampaignTables, campaign_of, read_seeds, tables_of
from colibri.campaigns.factors import CampaignError
from tests.support.campaigns import DRAWN, MASS, planned
from tests.support.refusals import refusal_of

FILE = """
name = "mass"
seeds = "1-20"
[fly]
duration = 30
turbulence = "light"
[grid]
track = ["spiral", "lemniscate:lap=6"]
controller = ["lpv-mpc", "geometric-se3"]
[draw]
"plant-vehicle.body.mass_kg" = { uniform = [0.6, 0.8] }
"""


def test_a_file_is_every_combination_by_every_seed(tmp_path: Path) -> None:
    path = tmp_path / "mass.toml"
    path.write_text(FILE, encoding="utf-8")
    campaign = campaign_of(tables_of(CampaignTables, path, {}))
    assert (campaign.name, campaign.flights, campaign.combinations) == ("mass", 80, 4)
    points = list(campaign.points())
    assert [point.flight for point in points] == list(range(80))
    expected = product(["spiral", "lemniscate:lap=6"], ["lpv-mpc", "geometric-se3"], range(1, 21))
    assert [(p.factors["track"], p.factors["controller"], p.seed) for p in points] == list(expected)
    masses = [point.factors[MASS] for point in points]
    assert len(set(masses)) == 80
    assert all(0.6 <= mass <= 0.8 for mass in masses)


def test_a_file_without_a_name_is_called_by_its_own(tmp_path: Path) -> None:
    path = tmp_path / "heavy.toml"
    path.write_text(FILE.replace('name = "mass"', ""), encoding="utf-8")
    assert tables_of(CampaignTables, path, {}).name == "heavy"


def test_each_flight_has_draws_of_its_own_stream() -> None:
    few, many = planned(draw=DRAWN, seeds="1-2"), planned(draw=DRAWN, seeds="1-9")
    masses = [[point.factors[MASS] for point in campaign.points()] for campaign in (few, many)]
    assert masses[0] == masses[1][:2]
    other = planned(draw=DRAWN, seeds="1-2", root_seed=1)
    assert masses[0][0] != next(other.points()).factors[MASS]


def test_draws_are_the_same_on_every_computer() -> None:
    draw = {MASS: {"uniform": [0.6, 0.8]}, "latency": {"normal": [5.0, 1.0]}, "floor": {"log-uniform": [0.01, 1.0]}}
    point = next(planned(draw=draw).points())
    assert [point.factors[name] for name in draw] == [0.788587510576576, 4.104054033756256, 0.27841022243806307]


def test_paired_draws_are_those_of_the_seed() -> None:
    grid = {"track": ["hover"], "controller": ["lpv-mpc", "geometric-se3"]}
    points = list(planned(grid=grid, draw=DRAWN, seeds="1-2", paired=True).points())
    assert [point.factors[MASS] for point in points[:2]] == [point.factors[MASS] for point in points[2:]]
    assert points[0].factors[MASS] != points[1].factors[MASS]


def test_a_factor_takes_the_place_of_what_the_file_has(tmp_path: Path) -> None:
    path = tmp_path / "mass.toml"
    path.write_text(FILE, encoding="utf-8")
    tables = tables_of(CampaignTables, path, {"fly": {"duration": 5}, "grid": {MASS: [0.7, 0.75]}, "seeds": 3})
    campaign = campaign_of(tables)
    assert campaign.fly == {"duration": 5, "turbulence": "light"}
    assert (list(campaign.grid), campaign.draw, tuple(campaign.seeds)) == (["track", "controller", MASS], {}, (3,))


def test_a_key_of_a_profile_may_go_without_saying_so() -> None:
    grid = {"track": ["hover"], "controllers.lpv-mpc.qp.tolerance": [1e-9], "plant_vehicle.body.mass_kg*": [1.0]}
    campaign = planned(grid=grid)
    assert list(campaign.grid) == ["track", "profile.controllers.lpv-mpc.qp.tolerance", "plant-vehicle.body.mass_kg*"]


def test_samples_have_each_value_once() -> None:
    grid = {"track": ["hover", "spiral", "line"], "latency": {"linspace": [0, 9, 10]}}
    points = list(planned(grid=grid, draw=DRAWN).samples())
    assert {point.factors["track"] for point in points} == {"hover", "spiral", "line"}
    assert {point.factors["latency"] for point in points} == {0.0, 9.0}
    assert {0.68, 0.74} < {point.factors[MASS] for point in points}


def test_samples_have_each_object() -> None:
    profiles = [colibri.load_profile(name) for name in ("flight", "thesis", "se3")]
    points = list(planned(grid={"track": ["hover"], "profile": profiles}).samples())
    assert [point.factors["profile"].name for point in points] == ["flight", "thesis", "se3"]


@pytest.mark.parametrize("given", [{"logs": "lots"}, {"root_seed": "1"}, {"paired": 1}, {"grid": None}, {"grids": {}}])
def test_keywords_are_as_strict_as_a_file(given: dict[str, Any]) -> None:
    assert next(iter(given)) in refusal_of(tables_of, CampaignTables, None, given)


@pytest.mark.parametrize(("given", "seeds"), [("1-3", (1, 2, 3)), (7, (7,)), ("7", (7,)), ([4, 2], (4, 2))])
def test_seeds_are_read(given: Any, seeds: tuple[int, ...]) -> None:
    assert tuple(read_seeds(given)) == seeds


@pytest.mark.parametrize("given", ["3-1", "x", "1-", "-1", [], [1, 1], [1.5], -4, None])
def test_what_is_no_seed_is_refused(given: Any) -> None:
    with pytest.raises(CampaignError, match="seeds: must be FIRST-LAST, a number, or a list of different numbers, not"):
        read_seeds(given)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"grid": {"trck": ["hover"]}}, 'unknown factor "trck" (did you mean "track"?)'),
        ({"grid": {"track": ["hover"], "colour": [1]}}, 'unknown factor "colour" (choose controller, delay,'),
        ({"grid": {"track": ["hover"], "seed": [1]}}, "seed is not a factor: set seeds"),
        ({"grid": {"track": ["hover"], "link": ["udp"]}}, "link is not a factor"),
        ({"fly": {"speed": 1.0}}, "speed is not a factor"),
        ({"grid": {}}, "no track: add one"),
        ({"fly": {"track": "hover"}}, "track is given twice: keep it in one of fly, grid and draw"),
        ({"metrics": ["rmse"]}, 'unknown metric "rmse" (did you mean "rmse_m"?)'),
        ({"metrics": []}, "metrics: name at least one: rmse_after_20s_m,"),
        ({"metrics": ["rmse_m", "rmse_m"]}, "rmse_m: the table would have two columns of that name: choose another"),
        ({"metrics": {"seed": len}}, "seed: the table would have two columns"),
        ({"grid": {"track": ["hover"], "rmse_m": {"one": {}}}}, "rmse_m: the table would have two columns"),
        ({"draw": DRAWN | {MASS.replace("-", "_"): {"choice": [0.7]}}}, f"{MASS} is given twice, under two names"),
        ({"root_seed": -1}, "root_seed: must not be below zero, not -1"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_one_line(tables: dict[str, Any], said: str) -> None:
    assert refusal_of(planned, **tables).startswith(said)


def test_a_file_with_an_unknown_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mass.toml"
    path.write_text(FILE + "[gird]\n", encoding="utf-8")
    with pytest.raises(CampaignError, match=r"mass.toml: Object contains unknown field `gird`"):
        tables_of(CampaignTables, path, {})
