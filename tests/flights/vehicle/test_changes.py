"""What a ground station changes on the ground: parameters, calibration, failures, restarts; and a wrong vehicle."""

from math import inf, nan

import pytest

from colibri.autopilot.ground.system_commands import REBOOT, SHUT_DOWN
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import starting_world, state_frame
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED, COMPONENT, DENIED, QUICK, SYSTEM, refused

pytestmark = QUICK

RESTART = mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
STORAGE, CALIBRATE = mav.MAV_CMD_PREFLIGHT_STORAGE, mav.MAV_CMD_PREFLIGHT_CALIBRATION


@pytest.mark.sitl(profile="se3")
def test_a_law_says_why_it_refuses_a_parameter(sitl: Sitl) -> None:
    refused(
        sitl,
        "GEO_POSIT_FREQU not changed: position_frequency_rad_s: Expected `float` > 0.0",
        *(sitl.set_param, "GEO_POSIT_FREQU", -4.0),
    )


def test_calibration_reports_progress_and_needs_rest(sitl: Sitl) -> None:
    assert sitl.command(CALIBRATE, 1.0) == ACCEPTED
    assert sitl.command(CALIBRATE, 0.0, 1.0) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    sitl.run(1.5)
    texts = [text for text in sitl.texts if text.startswith("[cal]")]
    assert texts[0] == "[cal] calibration started: 2 gyro"
    assert texts[-1] == "[cal] calibration done: gyro"
    assert texts[1:-1] == [f"[cal] progress <{part}>" for part in range(10, 101, 10)]
    assert sitl.command(CALIBRATE, 0.0, 0.0, 0.0, 0.0, 2.0) == ACCEPTED
    sitl.run(0.3)
    assert sitl.command(CALIBRATE) == ACCEPTED  # nothing chosen: cancelled
    sitl.run(0.05)
    assert sitl.texts[-1] == "[cal] calibration cancelled"
    for params in ((7.0,), (1.0, 1.0), (0.0, 0.0, 1.0), (inf,)):
        assert sitl.command(CALIBRATE, *params) == mav.MAV_RESULT_UNSUPPORTED
    sitl.arm()
    assert sitl.command(CALIBRATE, 1.0) == DENIED


def test_a_restart_is_for_the_ground(sitl: Sitl) -> None:
    sitl.arm()
    assert sitl.command(RESTART, 1.0) == DENIED
    assert sitl.command(STORAGE, 2.0) == DENIED
    sitl.disarm()
    for param in (0.0, 3.0, nan, 1.5):
        assert sitl.command(RESTART, param) == DENIED
    before = sitl.inside.copter
    assert before.stations.system.restart == 0.0
    for param, requested in ((1.0, REBOOT), (2.0, SHUT_DOWN)):
        copter = sitl.inside.copter
        sitl.send("COMMAND_LONG", SYSTEM, COMPONENT, RESTART, 0, param, *(0.0,) * 6)
        if requested == SHUT_DOWN:
            with pytest.raises(Exception, match="the autopilot ended with exit code 0"):
                sitl.run(0.1)
        else:
            sitl.run(0.1)
            assert sitl.inside.copter is not copter
        assert copter.stations.system.restart == requested


@pytest.mark.sitl(params={"MPC_XY_CRUISE": 3.0})
def test_stored_parameters_are_reset_by_command(sitl: Sitl) -> None:
    assert sitl.command(STORAGE, 1.0) == ACCEPTED
    assert sitl.get_param("MPC_XY_CRUISE") == 3.0
    assert sitl.command(STORAGE, 2.0) == ACCEPTED
    assert sitl.get_param("MPC_XY_CRUISE") == 5.0
    for param in (-1.0, 3.0, nan):
        assert sitl.command(STORAGE, param) == DENIED


def test_a_plant_that_begins_anew_restarts_the_autopilot(sitl: Sitl) -> None:
    sitl.takeoff(1.0)
    copter = sitl.inside.copter
    step = sitl.inside.autopilot.step(state_frame(starting_world(Start(), load_vehicle("hummingbird"))))
    assert not copter.pilot.state.armed
    assert not any(step.command.controls)
    assert copter.stations.system.restart == REBOOT
