from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from colibri.companion.stack import ARDUPILOT, PX4, ThrustCurve
from colibri.companion.supervision.phases import TABLE, CompanionPhase, PhaseCondition, SetpointRate, next_phase
from colibri.companion.supervision.rules import (
    AGES,
    CHECKS,
    LIMITS,
    CheckFacts,
    FlightFacts,
    FlightLimits,
    FlightRegion,
    exceeded,
    failing,
)
from colibri.mavlink.client.report import VehicleReport

BOX = FlightRegion((-3.0, -3.0, -1.0), (3.0, 3.0, 5.0))
QUIET = VehicleReport()
PX4_VALUES = dict.fromkeys(PX4.needed, 0.3)
ARDUPILOT_VALUES = {**dict.fromkeys(ARDUPILOT.needed, 0.3), "GUID_OPTIONS": 8.0}
GOOD = CheckFacts(
    stack=PX4,
    systems=(1,),
    home_moved_m=0.0,
    thrust=ThrustCurve(hover=0.4),
    parameters=PX4_VALUES,
    clock_known=True,
    clock_rate=1.0,
    ages={row.name: 0.1 for row in AGES},
    round_trip_s=0.02,
    state_age_s=0.01,
    state_rate_hz=100.0,
    state_delay_s=0.01,
    mode_rate_hz=25.0,
    report=VehicleReport(estimator_ok=True, prearm_ok=True, battery=0.8, altitude_amsl_m=500.0),
    may_arm=True,
    approach_m=2.0,
    contradiction="",
    box=BOX,
    limits=FlightLimits(),
)


def reporting(**changed: Any) -> CheckFacts:
    return replace(GOOD, report=replace(GOOD.report, **changed))


FAILS: list[tuple[str, CheckFacts]] = [
    ("vehicle", replace(GOOD, systems=(1, 2))),
    ("home", replace(GOOD, home_moved_m=1.1)),
    ("clock", replace(GOOD, clock_known=False)),
    ("clock", replace(GOOD, clock_rate=0.5)),
    *(("ages", replace(GOOD, ages={**GOOD.ages, row.name: row.start_s + 0.1})) for row in AGES),
    ("ages", replace(GOOD, ages={name: age for name, age in GOOD.ages.items() if name != "landed"})),
    ("reports", replace(GOOD, ages={"landed": 0.1})),
    ("altitude", reporting(altitude_amsl_m=nan)),
    ("consistency", replace(GOOD, contradiction="attitude and body rates contradict each other")),
    ("start", replace(GOOD, approach_m=50.1)),
    ("states", replace(GOOD, state_rate_hz=10.0)),
    ("states", replace(GOOD, state_age_s=inf)),
    ("delay", replace(GOOD, round_trip_s=0.3)),
    ("delay", replace(GOOD, state_delay_s=0.09)),
    ("modes", replace(GOOD, mode_rate_hz=1.0)),
    ("parameters", replace(GOOD, parameters=None)),
    ("settings", replace(GOOD, parameters={})),
    ("settings", replace(GOOD, parameters=PX4_VALUES | {"COM_OF_LOSS_T": 0.31})),
    ("settings", replace(GOOD, stack=ARDUPILOT, parameters=ARDUPILOT_VALUES | {"GUID_OPTIONS": 4.0})),
    ("settings", replace(GOOD, stack=ARDUPILOT, parameters=ARDUPILOT_VALUES | {"GUID_TIMEOUT": 0.5})),
    ("hover thrust", replace(GOOD, thrust=ThrustCurve(hover=0.95))),
    ("hover thrust", replace(GOOD, thrust=None)),
    ("estimator", reporting(estimator_ok=False)),
    ("pre-arm", reporting(prearm_ok=False)),
    ("battery", reporting(battery=0.2)),
    ("fence", reporting(fence_breached=True)),
    ("fence", replace(GOOD, parameters=PX4_VALUES | {"GF_MAX_VER_DIST": 4.0})),
    ("fence", replace(GOOD, parameters=PX4_VALUES | {"GF_MAX_HOR_DIST": 4.0})),
]


def test_the_page_lists_the_age_of_each_report() -> None:
    page = (Path(__file__).parents[3] / "docs" / "companion.md").read_text(encoding="utf-8")
    for row in AGES:
        flight = f"{row.flight_s:g} s" if row.flight_s < inf else "-"
        assert f"| {row.name} | {row.messages} | {row.start_s:g} s | {flight} |" in page


def test_a_vehicle_that_is_ready_passes_every_check() -> None:
    assert failing(GOOD) == failing(GOOD, required=False) == []
    assert failing(reporting(battery=nan, estimator_ok=None, prearm_ok=None)) == []
    fenceless = ARDUPILOT_VALUES | {"FENCE_ENABLE": 0.0, "FENCE_RADIUS": 1.0}
    assert failing(replace(GOOD, stack=ARDUPILOT, parameters=fenceless)) == []


@pytest.mark.parametrize(("name", "facts"), FAILS)
def test_each_check_fails_alone_and_says_what_to_do(name: str, facts: CheckFacts) -> None:
    lines = failing(facts) + failing(facts, required=False)
    assert len(lines) == 1
    assert lines[0].startswith(f"{name}: ")
    assert len(lines[0]) > len(name) + 20


def test_every_check_was_seen_to_fail() -> None:
    assert {name for name, _ in FAILS} == {check.name for check in CHECKS}


EXCEEDS = [
    ("late states", FlightFacts(QUIET, state_age_s=0.11), ""),
    ("contradiction", FlightFacts(QUIET, contradiction="position and velocity contradict each other"), "position"),
    *(
        ("stale reports", FlightFacts(QUIET, ages={row.name: row.flight_s + 0.1}), row.messages)
        for row in AGES
        if row.flight_s < inf
    ),
    ("estimate lost", FlightFacts(VehicleReport(estimator_ok=False)), ""),
    ("estimate jumped", FlightFacts(QUIET, jumped_m=2.0), ""),
    ("control law", FlightFacts(QUIET, law_error="it raised"), ""),
    ("overloaded", FlightFacts(QUIET, pace=0.79), ""),
    ("overloaded", FlightFacts(QUIET, gap_s=0.21), "210 ms ago"),
    ("box", FlightFacts(QUIET, box=BOX, position_enu_m=(0.0, 3.1, 0.0)), ""),
    ("box", FlightFacts(QUIET, box=BOX, position_enu_m=(nan, 0.0, 0.0)), ""),
    ("tilt", FlightFacts(QUIET, tilt_deg=51.0), ""),
    ("error", FlightFacts(QUIET, error_m=1.6), ""),
    ("battery", FlightFacts(VehicleReport(battery=0.1)), ""),
    ("fence", FlightFacts(VehicleReport(fence_breached=True)), ""),
    ("failsafe", FlightFacts(VehicleReport(system_status=5)), ""),
]


def test_each_limit_is_exceeded_alone_and_says_by_how_much() -> None:
    assert {limit.name for limit in LIMITS} == {name for name, _, _ in EXCEEDS}
    assert exceeded(FlightFacts(QUIET)) is None
    for name, facts, words in EXCEEDS:
        limit = exceeded(facts)
        assert limit is not None
        assert limit.name == name
        said = limit.words(facts)
        assert len(said) > 5
        assert words in said


def test_the_pace_counts_setpoints_of_the_last_second() -> None:
    pace = SetpointRate()
    pace.begin(5_000_000)
    assert pace.kept(5_900_000, 8_000) == 1.0
    for n in range(1, 126):
        pace.count(5_000_000 + 8_000 * n)
    assert pace.kept(6_000_000, 8_000) == pytest.approx(1.0)
    for n in range(1, 63):
        pace.count(6_000_000 + 16_000 * n)
    assert pace.kept(7_000_000, 8_000) == pytest.approx(0.5, abs=0.01)
    assert pace.gap_s(7_000_000) == pytest.approx(0.008)
    assert pace.kept(8_100_000, 8_000) == 0.0


def test_from_every_phase_in_the_air_a_pilot_and_a_stop_lead_out() -> None:
    for phase in [*CompanionPhase][2:-1]:  # arming to handing over
        everything = frozenset(PhaseCondition)
        assert next_phase(phase, everything) == (CompanionPhase.ENDED, PhaseCondition.PILOT)
        if phase is not CompanionPhase.HANDING_OVER:
            stopped = frozenset(
                {PhaseCondition.STOPPED, PhaseCondition.ARMED, PhaseCondition.OFFBOARD, PhaseCondition.UP}
            )
            assert next_phase(phase, stopped)[0] is CompanionPhase.HANDING_OVER
    for phase in CompanionPhase:
        assert next_phase(phase, frozenset()) == (phase, None)
    assert not any(CompanionPhase.ENDED in row.sources for row in TABLE)


def test_nothing_leads_to_arming_but_a_check_that_allows_it() -> None:
    rows = [row for row in TABLE if row.target is CompanionPhase.ARMING]
    assert [(row.sources, row.condition) for row in rows] == [
        ((CompanionPhase.CHECKING,), PhaseCondition.CHECKED_TO_ARM)
    ]
