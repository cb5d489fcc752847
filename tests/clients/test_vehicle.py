from pathlib import Path

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from tools.harness.sitl_process import vehicle


@pytest.mark.long
def test_it_stands_ready_and_ends_when_told_to(tmp_path: Path) -> None:
    with vehicle(tmp_path, speed=5.0) as flown:
        seen = flown.seen.wait(lambda sight: sight.time_s > 1.0, "a second")
        assert seen.mode is Mode.HOLD
        assert not seen.armed
        assert not seen.flying
        assert abs(seen.height_m) < 1e-3
        assert flown.port > 0
        assert flown.end() == 0
