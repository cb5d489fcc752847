from math import hypot, nan

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.wire.dialect import mav
from tools.harness.copter_flight import CopterFlight

RADIUS_M, SPEED_M_S, HEIGHT_M = 4.0, 2.0, 3.0


def test_an_orbit_keeps_its_radius_speed_and_height() -> None:
    """The frame says above home, and the height is above sea level: so MAVSDK sends it, and PX4 reads it."""
    flown = CopterFlight()
    flown.takeoff(HEIGHT_M)
    orbit = (RADIUS_M, SPEED_M_S, mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER, nan)
    frame = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
    altitude_m = DEFAULT_ORIGIN.altitude_m + HEIGHT_M
    assert flown.command_int(mav.MAV_CMD_DO_ORBIT, *orbit, frame=frame, z=altitude_m) == mav.MAV_RESULT_ACCEPTED
    assert flown.mode is Mode.ORBIT
    flown.run(8.0)
    for _ in range(40):
        flown.run(0.1)
        east, north, up = flown.position
        assert hypot(east, north) == pytest.approx(RADIUS_M, abs=0.1)
        assert hypot(*flown.velocity) == pytest.approx(SPEED_M_S, abs=0.1)
        assert up == pytest.approx(HEIGHT_M, abs=0.05)


def test_nobody_selects_an_orbit_without_a_circle() -> None:
    flown = CopterFlight()
    flown.takeoff()
    assert flown.select(Mode.ORBIT) == mav.MAV_RESULT_DENIED
    assert flown.mode is Mode.HOLD
