"""What changes a vehicle in flight and on the ground: parameters, calibration, failures, restarts, time."""

from itertools import pairwise
from math import degrees, dist, hypot, nan

import pytest
from msgspec import structs

from colibri.autopilot.commander.rules.modes import FIRST, Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.ground.system_commands import REBOOT, SHUT_DOWN
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import load_vehicle
from tools.harness.client import COMPONENT, SYSTEM
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight, in_the_air


def test_a_speed_and_a_behaviour_act_at_once() -> None:
    flight = in_the_air()
    flight.goto(50.0, 0.0, 5.0)
    flight.run(2.5)
    flight.set_param("MPC_XY_CRUISE", 2.0)
    flight.run(2.0)
    assert hypot(*flight.velocity) == pytest.approx(2.0, abs=0.05)
    flight.set_param("MPC_XY_VEL_MAX", 1.0)  # less than the cruise speed: that holds
    flight.run(1.0)
    assert hypot(*flight.velocity) == pytest.approx(1.0, abs=0.05)
    flight.set_param("MPC_LAND_SPEED", 0.3)
    flight.set_param("MPC_Z_VEL_MAX_DN", 0.3)
    flight.select(Mode.LAND)
    flight.run(3.0)
    assert flight.velocity[2] == pytest.approx(-0.3, abs=0.03)


@pytest.mark.parametrize(
    ("name", "value"),
    [("MPC_JERK_MAX", 5.0), ("WHL_Q_POSITION", 50.0), ("WHL_POLE1", -5.0), ("VEH_MASS", 0.733), ("TRACK", 3)],
)
def test_a_number_that_changes_in_flight_jolts_nothing(name: str, value: Value) -> None:
    flight = in_the_air(wind_enu_m_s=(3.0, 0.0, 0.0))
    flight.goto(30.0, 0.0, 5.0)
    flight.run(1.5)
    tilts = [flight.euler]
    flight.set_param(name, value)
    flight.run(0.3, lambda: tilts.append(flight.euler))
    jolts = [degrees(dist(before, after)) for before, after in pairwise(tilts)]
    assert max(jolts) < 1.2  # in 8 ms
    flight.run(1.0)
    assert flight.velocity[0] > 3.0


def test_why_a_control_law_refuses_a_number_is_heard() -> None:
    flight = CopterFlight(profile=load_profile("se3"))
    before = flight.copter.parameters["GEO_POSIT_FREQU"]
    flight.client.send("PARAM_SET", SYSTEM, COMPONENT, b"GEO_POSIT_FREQU", -4.0, mav.MAV_PARAM_TYPE_REAL32)
    flight.run(0.1)
    assert flight.copter.parameters["GEO_POSIT_FREQU"] == before
    assert flight.client.said("GEO_POSIT_FREQU not changed: position_frequency_rad_s: Expected `float` > 0.0")


def test_a_heavier_vehicle_than_is_believed_flies_and_lands() -> None:
    nominal = load_vehicle("hummingbird")
    body = structs.replace(nominal.body, mass_kg=1.15 * nominal.body.mass_kg)
    heavy = structs.replace(nominal, body=body)
    flight = CopterFlight(vehicle=heavy, values={"COM_DISARM_LAND": 0.1})
    flight.takeoff(1.5)
    flight.run(1.5)
    assert flight.position[2] == pytest.approx(1.5, abs=0.1)
    flight.land()


def test_calibration_tells_its_progress_and_needs_the_rotors_still() -> None:
    flight = CopterFlight()
    calibrate = mav.MAV_CMD_PREFLIGHT_CALIBRATION
    assert flight.command(calibrate, 1.0) == ACCEPTED
    assert flight.command(calibrate, 0.0, 1.0) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    flight.run(1.5)
    texts = [text for text in flight.client.texts if text.startswith("[cal]")]
    assert texts[0] == "[cal] calibration started: 2 gyro"
    assert texts[-1] == "[cal] calibration done: gyro"
    assert texts[1:-1] == [f"[cal] progress <{part}>" for part in range(10, 101, 10)]
    assert flight.command(calibrate, 0.0, 0.0, 0.0, 0.0, 2.0) == ACCEPTED
    flight.run(0.3)
    assert flight.command(calibrate) == ACCEPTED  # nothing chosen: cancelled
    flight.run(0.05)
    assert flight.client.texts[-1] == "[cal] calibration cancelled"
    for params in ((7.0,), (1.0, 1.0), (0.0, 0.0, 1.0), (float("inf"),)):
        assert flight.command(calibrate, *params) == mav.MAV_RESULT_UNSUPPORTED
    flight.arm()
    assert flight.command(calibrate, 1.0) == DENIED


def test_failures_are_injected_only_where_a_parameter_says_so() -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=1)
    inject, gps, off, ok = mav.MAV_CMD_INJECT_FAILURE, 4.0, 1.0, 0.0
    assert flight.command(inject, gps, off) == DENIED
    flight.set_param("SYS_FAILURE_EN", 1)
    assert flight.command(inject, gps, off) == ACCEPTED
    flight.run(1.2)
    assert flight.client.latest("GPS_RAW_INT").fix_type == mav.GPS_FIX_TYPE_NO_GPS
    assert flight.command(inject, gps, ok) == ACCEPTED
    flight.run(1.2)
    assert flight.client.latest("GPS_RAW_INT").fix_type >= mav.GPS_FIX_TYPE_3D_FIX


def test_a_restart_is_for_the_ground() -> None:
    flight = CopterFlight()
    restart = mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    flight.arm()
    assert flight.command(restart, 1.0) == DENIED
    assert flight.command(mav.MAV_CMD_PREFLIGHT_STORAGE, 2.0) == DENIED
    flight.disarm()
    for param in (0.0, 3.0, nan, 1.5):
        assert flight.command(restart, param) == DENIED
    assert flight.copter.stations.system.restart == 0.0
    assert flight.command(restart, 1.0) == ACCEPTED
    assert flight.copter.stations.system.restart == REBOOT
    assert flight.command(restart, 2.0) == ACCEPTED
    assert flight.copter.stations.system.restart == SHUT_DOWN


def test_stored_parameters_are_reset_by_command() -> None:
    flight = CopterFlight(values={"MPC_XY_CRUISE": 3.0})
    storage = mav.MAV_CMD_PREFLIGHT_STORAGE
    assert flight.command(storage, 1.0) == ACCEPTED
    assert flight.copter.parameters["MPC_XY_CRUISE"] == 3.0
    assert flight.command(storage, 2.0) == ACCEPTED
    assert flight.copter.parameters["MPC_XY_CRUISE"] == 5.0
    for param in (-1.0, 3.0, nan):
        assert flight.command(storage, param) == DENIED


def test_a_plant_that_begins_anew_asks_for_a_new_vehicle() -> None:
    flight = in_the_air()
    flight.run(1.0)
    flight.world = CopterFlight().world
    flight.run(0.05)
    assert flight.copter.pilot.state == FIRST
    assert not any(flight.rotors.controls)
    assert flight.copter.stations.system.restart == REBOOT


def test_frames_that_were_missed_do_not_end_a_flight() -> None:
    flight = in_the_air()
    flight.run(0.5)
    flight.skip(3)
    flight.run(1.0)
    assert flight.copter.pilot.state == (Mode.HOLD, True)
    assert flight.position == pytest.approx((0.0, 0.0, 5.0), abs=0.2)


def test_orders_for_others_are_not_ours() -> None:
    flight = CopterFlight()
    arm = (mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for system, component in ((2, COMPONENT), (SYSTEM, 2), (0, 2)):
        flight.send("COMMAND_LONG", system, component, *arm)
    flight.run(0.1)
    assert not flight.armed
    assert not flight.client.acks
    flight.send("COMMAND_LONG", SYSTEM, 0, *arm)
    flight.run(0.05)
    assert flight.armed
