"""Parameters of the autopilot before a flight: `--set`, `params`, in campaigns, and what is refused."""

from pathlib import Path
from typing import Any

import pytest

import colibri
from colibri.cli.main import main
from colibri.flights.provenance import plan_of
from colibri.flights.replay import replay_flight
from tests.support.refusals import refusal_of

HOVER: dict[str, Any] = {"duration": 0.3, "start": {"x": 0.3}}


@pytest.mark.long
def test_both_links_and_python_fly_the_same_parameters(tmp_path: Path) -> None:
    plain = colibri.fly("hover", **HOVER)
    flights = [colibri.fly("hover", params=params, **HOVER) for params in ({"LPV_R_NEXT": 0.3}, ["LPV_R_NEXT=0.3"])]
    hashes = {flight.sha256 for flight in flights}
    for link in ("memory", "udp"):
        out = tmp_path / link
        options = ["--duration", "0.3", "--start", "x=0.3", "--no-figures", "--quiet", "--out", str(out)]
        assert main(["fly", "hover", "--link", link, "--set", "LPV_R_NEXT=9", "--set", "LPV_R_NEXT=0.3", *options]) == 0
        assert replay_flight(out).difference is None
        assert plan_of(out).profile == flights[0].plan.profile
        hashes.add(colibri.load_flight(out).sha256)
    assert len(hashes) == 1
    assert plain.sha256 not in hashes


def test_a_vehicle_parameter_is_the_autopilots_alone() -> None:
    plan = colibri.fly("hover", params={"VEH_MASS": 0.8}, **HOVER).plan
    assert plan.vehicle.body.mass_kg == pytest.approx(0.8)
    assert plan.plant_vehicle.body.mass_kg == pytest.approx(0.71, abs=0.05)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"LPV_R_NEX": 1.0}, 'unknown parameter "LPV_R_NEX" (did you mean "LPV_R_NEXT"?)'),
        ({"LPV_R_NEXT": -1.0}, "LPV_R_NEXT: must be a number from 0.0001 to 100, not -1.0"),
        ({"COM_RC_LOSS_T": 1.0}, "COM_RC_LOSS_T: acts with ground stations only: give --gcs"),
        ({"LPV_R_NEXT": "much"}, 'params: LPV_R_NEXT must be a number, not str "much"'),
        ({"LPV_R_NEXT": float("nan")}, 'params: LPV_R_NEXT must be a number, not float "nan"'),
        ({"LPV_R_NEXT": True}, "params: LPV_R_NEXT must be a number, not bool"),
        ("LPV_R_NEXT", 'params: must be NAME=VALUE, for example "VEH_MASS=0.7", not "LPV_R_NEXT"'),
        ([3], 'params: must be a table of numbers, not int "3"'),
    ],
)
def test_wrong_parameters_are_refused_in_one_line(params: Any, said: str) -> None:
    assert refusal_of(colibri.fly, "hover", params=params, **HOVER).startswith(said)


def test_a_campaign_sets_parameters() -> None:
    fly = {"track": "hover", **HOVER, "params": {"LPV_R_NEXT": 0.3}}
    (flown,) = colibri.campaign(fly=fly, workers=1).flown
    assert flown.sha256 == colibri.fly(**fly).sha256
