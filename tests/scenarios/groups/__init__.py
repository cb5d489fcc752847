"""Scenarios, by group."""

from collections.abc import Mapping, Sequence

from tests.scenarios.groups import (
    arming,
    failsafes,
    faults,
    fleet,
    holding,
    links,
    malformed,
    missions,
    offboard,
    takeoff_land,
    tracking,
)
from tests.scenarios.words.scenario import FleetScenario, Scenario

GROUPS: Mapping[str, Sequence[Scenario | FleetScenario]] = {
    "arming": arming.SCENARIOS,
    "takeoff-land": takeoff_land.SCENARIOS,
    "hold-wind": holding.SCENARIOS,
    "tracking": tracking.SCENARIOS,
    "mission": missions.SCENARIOS,
    "offboard": offboard.SCENARIOS,
    "failsafes": failsafes.SCENARIOS,
    "faults": faults.SCENARIOS,
    "link-process": links.SCENARIOS,
    "malformed": malformed.SCENARIOS,
    "fleet": fleet.SCENARIOS,
}
