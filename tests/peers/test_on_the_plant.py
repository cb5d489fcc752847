"""Real PX4 and ArduCopter fly our plant by the parameters of the vehicle file.

COLIBRI_PX4 is a build folder of PX4's SITL (`build/px4_sitl_default`), COLIBRI_ARDUCOPTER the program `arducopter`.
Both bind to all addresses: they run in a network namespace with loopback alone.
"""

import sys
from pathlib import Path
from subprocess import run

import numpy as np
import pytest

from tests.peers.on_the_plant import HOVER_S, TAKE_OFF_M
from tests.peers.programs import ALONE, PROGRAMS, program_of
from tools.harness.processes import topic_rows

pytestmark = pytest.mark.peers

HEIGHT_M = {"px4": 2.5, "ardupilot": TAKE_OFF_M}
MINUTES = 6.0


@pytest.mark.parametrize("whom", PROGRAMS)
def test_it_takes_off_and_hovers_and_so_does_the_next(whom: str, tmp_path: Path) -> None:
    command = [*ALONE, sys.executable, "-m", "tests.peers.on_the_plant", whom, str(program_of(whom)), str(tmp_path)]
    run(command, check=True, timeout=60.0 * MINUTES)
    for name in ("flight-1.ulg", "flight.ulg"):
        flown = topic_rows(tmp_path / "plant" / name)
        assert flown["t"][0] < 0.01
        assert np.diff(flown["t"]).min() > 0.0
        hovering = flown["t"] > flown["t"][-1] - 0.5 * HOVER_S
        assert flown["z"][hovering] == pytest.approx(HEIGHT_M[whom], abs=0.75)
        assert np.hypot(flown["x"], flown["y"])[hovering].max() < 1.5
        assert np.hypot(flown["qx"], flown["qy"])[hovering].max() < 0.05
