from collections.abc import Callable

import pytest

from colibri.sitl.vehicle import Sitl
from tests.scenarios.groups import GROUPS
from tests.scenarios.words.scenario import FleetScenario, Scenario

pytestmark = pytest.mark.scenarios

ALONE = [
    pytest.param(
        scenario,
        id=f"{group}-{scenario.name}" + (f"-seed{seed}" if scenario.seeds != (0,) else ""),
        marks=[
            pytest.mark.sitl(**{"seed": seed, **scenario.setting}),
            *([pytest.mark.calm(reason=scenario.calm)] if scenario.calm else []),
        ],
    )
    for group, scenarios in GROUPS.items()
    for scenario in scenarios
    if isinstance(scenario, Scenario)
    for seed in scenario.seeds
]
TOGETHER = [
    pytest.param(scenario, id=f"{group}-{scenario.name}", marks=pytest.mark.sitl(**scenario.setting))
    for group, scenarios in GROUPS.items()
    for scenario in scenarios
    if isinstance(scenario, FleetScenario)
]


@pytest.mark.parametrize("scenario", ALONE)
def test_scenario(sitl: Sitl, scenario: Scenario) -> None:
    for step in scenario.steps:
        step(sitl)


@pytest.mark.parametrize("scenario", TOGETHER)
def test_fleet(sitl_fleet: Callable[[int], list[Sitl]], scenario: FleetScenario) -> None:
    scenario.fly(sitl_fleet(scenario.count))
