"""A rangefinder that looks down: height above the ground is known to centimetres, and no fault of it brings it down."""

from functools import lru_cache

import msgspec
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.wire.dialect import mav
from tools.harness.copter_flight import ACCEPTED, CopterFlight

HEIGHT_M = 2.0


def vehicle(name: str) -> CopterFlight:
    profile = load_profile("flight")
    simulation = msgspec.structs.replace(profile.simulation, vehicle=name)
    flight = CopterFlight(
        profile=msgspec.structs.replace(profile, simulation=simulation), feedback=Feedback.SENSORS, seed=1
    )
    flight.takeoff(HEIGHT_M)
    assert flight.goto(0.0, 0.0, HEIGHT_M) == ACCEPTED
    flight.run(6.0)
    return flight


@lru_cache(maxsize=1)
def hovering() -> CopterFlight:
    return vehicle("hummingbird-rangefinder")


def test_it_hovers_where_it_should_and_is_decimetres_off_without() -> None:
    assert hovering().position[2] == pytest.approx(HEIGHT_M, abs=0.03)
    assert abs(vehicle("hummingbird").position[2] - HEIGHT_M) > 0.2


def test_ground_stations_are_told_what_it_measures() -> None:
    flight = hovering()
    for name in ("DISTANCE_SENSOR", "SYS_STATUS"):
        assert flight.command(mav.MAV_CMD_REQUEST_MESSAGE, float(getattr(mav, f"MAVLINK_MSG_ID_{name}"))) == ACCEPTED
    flight.run(0.1)
    reading, status = (flight.client.latest(name) for name in ("DISTANCE_SENSOR", "SYS_STATUS"))
    assert reading.current_distance == pytest.approx(100.0 * HEIGHT_M + 12.0, abs=12.0)
    assert (reading.min_distance, reading.max_distance, reading.signal_quality) == (5, 4000, 100)
    assert status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_LASER_POSITION


@pytest.mark.parametrize(("kind", "value"), [("OFF", 0.0), ("STUCK", 0.0), ("WRONG", 1.0)])
def test_a_fault_is_said_and_the_height_kept(kind: str, value: float) -> None:
    flight = hovering()
    flight.set_param("SYS_FAILURE_EN", 1)
    fault = (float(mav.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR), float(getattr(mav, f"FAILURE_TYPE_{kind}")), 0.0, value)
    assert flight.command(mav.MAV_CMD_INJECT_FAILURE, *fault) == ACCEPTED
    flight.run(2.5)
    assert flight.estimate is not None
    assert flight.estimate.health.not_accepted == ("rangefinder",)
    assert flight.position[2] == pytest.approx(HEIGHT_M, abs=0.2)
    assert flight.command(mav.MAV_CMD_INJECT_FAILURE, fault[0], float(mav.FAILURE_TYPE_OK)) == ACCEPTED
    flight.run(1.0)
    assert not flight.estimate.health.not_accepted


def test_it_lands() -> None:
    flight = hovering()
    assert flight.select(Mode.LAND) == ACCEPTED
    flight.wait_until(lambda: not flight.armed, within=30.0, what="the landing")
    assert abs(flight.position[2]) < 0.01
