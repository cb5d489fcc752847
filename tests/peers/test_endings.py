"""Whatever ends a flight of the companion ends it on real PX4, too: `tests.peers.endings` provokes each once.

COLIBRI_PX4 is a build folder of PX4's SITL (`build/px4_sitl_default`).
"""

import json
import sys
from subprocess import run
from typing import Any

import pytest

from colibri.companion.stack import HOLD, OFFBOARD
from tests.peers.endings import CASES
from tests.peers.programs import ALONE, program_of

pytestmark = pytest.mark.peers

MINUTES = 8.0
OBEYED_WITHIN_S = 0.1
RETURN = 5 << 24 | 4 << 16
LIMITS = [name for name in CASES if name not in ("pilot", "interrupted", "estimate lost")]


@pytest.fixture(scope="module")
def endings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    folder, program = tmp_path_factory.mktemp("endings"), program_of("px4")
    command = [*ALONE, sys.executable, "-m", "tests.peers.endings", str(program), str(folder)]
    run(command, check=True, timeout=60 * MINUTES)
    found: dict[str, dict[str, Any]] = json.loads((folder / "endings.json").read_text(encoding="utf-8"))
    return found


def test_a_pilot_is_obeyed_and_an_interruption_leaves_it_in_hold(endings: dict[str, dict[str, Any]]) -> None:
    for name, mode in (("pilot", RETURN), ("interrupted", HOLD.custom)):
        assert (endings[name]["in_order"], endings[name]["mode"]) == (True, mode)
    assert endings["pilot"]["sent_after_disturbed_s"] <= OBEYED_WITHIN_S


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_ends_it_and_the_vehicle_holds_by_itself(endings: dict[str, dict[str, Any]], name: str) -> None:
    ended = endings[name]
    assert ended["limit"] == name
    assert not ended["in_order"]
    assert ended["mode"] == HOLD.custom


def test_a_vehicle_without_position_is_released_at_once(endings: dict[str, dict[str, Any]]) -> None:
    ended = endings["estimate lost"]
    assert ended["limit"] == "estimate lost"
    assert ended["sent_after_disturbed_s"] <= ended["limit_after_disturbed_s"]
    assert ended["mode"] != OFFBOARD.custom
