"""An option without effect on a flight is named, with the reason; and only such an option is."""

from typing import Any

import pytest

import colibri
from colibri.campaigns.run import fly_campaign
from colibri.flights.effects import RULES, NoEffectWarning
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec
from tests.support.campaigns import Here, planned

THESIS, FLIGHT = {"profile": "thesis"}, {"profile": "flight"}
GUST = "6@270:start={},duration=0.3"
CASES: tuple[tuple[str, Any, dict[str, Any], str], ...] = (
    ("wind", "8@270", THESIS, "vehicle hummingbird-thesis has no drag"),
    ("wind", "8@270", FLIGHT | {"without": "drag"}, "vehicle hummingbird has no drag"),
    ("wind", "8@270", FLIGHT, ""),
    ("gusts", GUST.format(0), THESIS, "vehicle hummingbird-thesis has no drag"),
    ("gusts", GUST.format(9), FLIGHT, "each begins after the flight"),
    ("gusts", GUST.format(0), FLIGHT, ""),
    ("events", "0:wind=8@270", THESIS, "vehicle hummingbird-thesis has no drag"),
    ("events", "9:payload=0.1", FLIGHT, "each is after the flight"),
    ("events", "0:payload=0.1", FLIGHT, ""),
    ("turbulence", "severe", THESIS, "vehicle hummingbird-thesis has no drag"),
    ("turbulence", "severe", FLIGHT, ""),
    ("seed", 3, FLIGHT, "only sensors, turbulence on drag, and noise are random"),
    ("seed", 3, FLIGHT | {"turbulence": "light"}, ""),
    ("seed", 3, FLIGHT | {"noise": "force=0.01"}, ""),
    ("noise", {"motors": 0.001}, FLIGHT, ""),
    ("noise", "force=0,motors=0", FLIGHT, "each is 0"),
    ("without", "drag", THESIS, "vehicle hummingbird-thesis has no such part"),
    ("without", "drag", FLIGHT, ""),
    ("start", {"rotors": 2000}, THESIS, "rotors of vehicle hummingbird-thesis follow commands at once"),
    ("start", {"rotors": 2000}, FLIGHT, ""),
    ("plant_vehicle", "hummingbird", FLIGHT, "it is the vehicle of the autopilot"),
    ("plant_vehicle", "hummingbird-thesis", FLIGHT, ""),
)
NOT_KEYWORDS = ("tlog", "signing_key", "insecure", "spacing")


@pytest.mark.filterwarnings("ignore::colibri.flights.effects.NoEffectWarning")
@pytest.mark.parametrize(("option", "value", "others", "reason"), CASES)
def test_what_has_no_effect_is_named(option: str, value: Any, others: dict[str, Any], reason: str) -> None:
    without, with_it = (colibri.fly("hover", duration=0.5, **others, **given) for given in ({}, {option: value}))
    assert with_it.report["without_effect"].get(option, "") == reason
    assert (with_it.sha256 == without.sha256) == bool(reason)


def test_every_row_is_tried() -> None:
    assert {option for option, _, _ in RULES} == {case[0] for case in CASES} | set(NOT_KEYWORDS)


@pytest.mark.parametrize(
    ("option", "value", "others"),
    [("tlog", True, {"link": "direct"}), ("signing_key", "key", {}), ("insecure", True, {})],
)
def test_options_of_links_need_their_link(option: str, value: Any, others: dict[str, Any]) -> None:
    plan = FlightPlan.of(FlightSpec.of("hover", **others, **{option: value}))
    assert option in plan.without_effect


def test_one_line_is_said_from_python() -> None:
    with pytest.warns(NoEffectWarning, match=r"^no effect: wind and turbulence \(vehicle .* has no drag\)$"):
        colibri.fly("hover", duration=0.5, wind="8@270", turbulence="severe", **THESIS)


def test_a_campaign_names_options_and_factors_without_effect() -> None:
    idle = "profile.controllers.global-lpv-mpc.horizon"
    fly = {"track": "hover", "duration": 0.5, "profile": "thesis", "plant_vehicle": "hummingbird"}
    campaign = planned(
        fly=fly, grid={idle: [4, 5], "wind": ["1@0", "2@0"], "without": ["drag", "battery"]}, seeds=[0, 1]
    )
    assert fly_campaign(campaign, Here(), None).notes == [
        "no effect: seed (only sensors, turbulence on drag, and noise are random)",
        "no effect on some flights: wind (vehicle hummingbird has no drag)",
        f"no effect: {idle} (flights that differ only in these are identical)",
    ]
