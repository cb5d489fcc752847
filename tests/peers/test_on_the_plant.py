"""Real PX4 and ArduCopter fly our plant by the parameters of the vehicle file.

COLIBRI_PX4 is a build folder of PX4's SITL (`build/px4_sitl_default`), COLIBRI_ARDUCOPTER the program `arducopter`.
Both bind to all addresses: they run in a network namespace with loopback alone.
"""

import os
import sys
from pathlib import Path
from subprocess import DEVNULL, run

import numpy as np
import pytest

from tests.peers.on_the_plant import HOVER_S, TAKE_OFF_M
from tools.harness.processes import rows

pytestmark = pytest.mark.peers

PROGRAMS = {"px4": "COLIBRI_PX4", "ardupilot": "COLIBRI_ARDUCOPTER"}
HEIGHT_M = {"px4": 2.5, "ardupilot": TAKE_OFF_M}
ALONE = ("unshare", "--map-root-user", "--net", "sh", "-c", 'ip link set lo up && exec "$0" "$@"')
MINUTES = 6.0


def can_be_alone() -> bool:
    """Whether this system lets a user have a network namespace."""
    try:
        return run([*ALONE, "true"], stdout=DEVNULL, stderr=DEVNULL, check=False).returncode == 0
    except OSError:
        return False


@pytest.mark.parametrize("whom", PROGRAMS)
def test_it_takes_off_and_hovers_and_so_does_the_next(whom: str, tmp_path: Path) -> None:
    program = os.environ.get(PROGRAMS[whom])
    if not program:
        pytest.skip(f"{PROGRAMS[whom]} does not say where {whom} is")
    if not can_be_alone():
        pytest.skip("no network namespace to be had: unshare --map-root-user --net")
    command = [*ALONE, sys.executable, "-m", "tests.peers.on_the_plant", whom, program, str(tmp_path)]
    run(command, check=True, timeout=60.0 * MINUTES)
    for name in ("plant-1.csv", "plant.csv"):
        flown = rows(tmp_path / "plant" / name)
        assert flown["t"][0] < 0.01
        assert np.diff(flown["t"]).min() > 0.0
        hovering = flown["t"] > flown["t"][-1] - 0.5 * HOVER_S
        assert flown["z"][hovering] == pytest.approx(HEIGHT_M[whom], abs=0.75)
        assert np.hypot(flown["x"], flown["y"])[hovering].max() < 1.5
        assert np.hypot(flown["qx"], flown["qy"])[hovering].max() < 0.05
