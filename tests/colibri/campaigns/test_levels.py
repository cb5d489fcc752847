from pathlib import Path
from typing import Any

import pytest

from colibri.campaigns.definition import CampaignTables, campaign_of, tables_of, usual
from colibri.campaigns.flights import check, common_of, plan_point
from colibri.campaigns.journal import identity_of
from colibri.common.errors import Error
from colibri.plant.vehicle.description import load_vehicle
from tests.support.campaigns import MASS, planned, results
from tests.support.refusals import refusal_of

FILE = """
[fly]
duration = 30
[grid]
track = ["hover", "spiral"]
[grid.contender]
mpc = { controller = "lpv-mpc" }
baseline = { profile = "se3", feedback = "sensors" }
[grid.plant.nominal]
[grid.plant.heavy]
"plant-vehicle.body.mass_kg*" = 1.2
without = ["drag", "ground"]
"""
HEAVY = {"plant": {"nominal": {}, "heavy": {f"{MASS}*": 1.2}}}


def test_each_level_sets_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "levels.toml"
    file.write_text(FILE, encoding="utf-8")
    campaign = campaign_of(tables_of(CampaignTables, file, {}))
    assert campaign.factors == ("track", "contender", "plant")
    assert campaign.flights == 8
    points = list(campaign.points())
    settings = [point.settings for point in points if point.factors["track"] == "hover"]
    mpc, heavy = {"controller": "lpv-mpc"}, {f"{MASS}*": 1.2, "without": ["drag", "ground"]}
    baseline = {"profile": "se3", "feedback": "sensors"}
    hover = {"track": "hover"}
    assert settings == [hover | mpc, hover | mpc | heavy, hover | baseline, hover | baseline | heavy]
    assert campaign.metrics == usual(sensors=True)
    plan = plan_point(common_of(campaign), points[1])
    nominal = load_vehicle("hummingbird")
    assert (plan.profile.name, plan.profile.controller, plan.vehicle) == ("flight", "lpv-mpc", nominal)
    assert plan.plant_vehicle.body.mass_kg == 1.2 * nominal.body.mass_kg
    assert plan.plant_vehicle.drag is None


def test_tables_call_a_level_by_its_name() -> None:
    table = results(grid={"track": ["hover"]} | HEAVY, metrics=["rmse_m"])
    assert table.headings[:4] == ("flight", "track", "plant", "seed")
    assert [row[2] for row in table.rows()] == ["nominal", "heavy"]
    assert list(table.groups()) == [("hover", "nominal"), ("hover", "heavy")]
    assert len({row[-1] for row in table.rows()}) == 2, "they are other flights"
    assert list(table.flights["plant"]) == ["nominal", "heavy"]


def test_a_campaign_is_another_one_if_a_level_is() -> None:
    def identity(levels: dict[str, Any]) -> dict[str, Any]:
        campaign = planned(grid={"track": ["hover"], "plant": levels})
        return identity_of(campaign, common_of(campaign))

    assert identity({"heavy": {MASS: 0.8}}) == identity({"heavy": {MASS: 0.8}})
    assert identity({"heavy": {MASS: 0.8}}) != identity({"heavy": {MASS: 0.9}})


@pytest.mark.parametrize("level", ["one", "two", "three"])
def test_every_level_is_tried_before_anything_flies(level: str) -> None:
    levels: dict[str, dict[str, Any]] = {name: {} for name in ("one", "two", "three")}
    campaign = planned(grid={"track": ["hover"], "plant": levels | {level: {"plant-vehicle.body.mas_kg": 1.0}}})
    with pytest.raises(Error, match='did you mean "mass_kg"'):
        check(campaign.samples(), common_of(campaign))


def test_what_a_file_has_as_levels_can_be_replaced(tmp_path: Path) -> None:
    file = tmp_path / "levels.toml"
    file.write_text(FILE, encoding="utf-8")
    tables = tables_of(CampaignTables, file, {"grid": {"plant": {"light": {MASS: 0.6}}}})
    assert tables.grid["plant"] == {"light": {MASS: 0.6}}
    assert tables.grid["contender"] == tables_of(CampaignTables, file, {}).grid["contender"]


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"grid": {"track": ["hover"], "plant": {"heavy": {"mass": 1.0}}}}, 'unknown factor "mass" '),
        ({"grid": {"track": {"one": {"profile": "se3"}}}}, "track: a factor with levels needs "),
        (
            {"grid": {"track": ["hover"], "verdict": {"one": {}}}},
            "verdict: the table would have two columns of that name",
        ),
        ({"grid": {"track": ["hover"], "plant": {"one": {"duration": 1.0}}}}, "duration is given twice"),
        ({"grid": {"track": ["hover"], "a": {"x": {MASS: 1}}, "b": {"x": {MASS: 2}}}}, f"{MASS} is given twice"),
        ({"grid": {"plant": {"one": {"link": "memory"}}}}, "link is not a factor"),
        ({"grid": {"plant": {"one": {}}}}, "no track: add one"),
    ],
)
def test_what_is_no_level_is_refused_in_one_line(tables: dict[str, Any], said: str) -> None:
    assert refusal_of(planned, **tables).startswith(said)
