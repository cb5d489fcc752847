import pytest

from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from tests.support.lockstep_ends import INTERVAL_US


@pytest.fixture
def plant() -> PlantEnd:
    return PlantEnd(system_id=1, frame_interval_us=4_000, takes_ahead=True)


@pytest.fixture
def autopilot() -> AutopilotEnd:
    return AutopilotEnd(system_id=1, frame_interval_us=INTERVAL_US, now_s=0.0)
