"""A vehicle that ground stations fly on its sensors: from arming to landing, and when a sensor fails."""

from math import dist, hypot

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.wire.dialect import mav
from tools.harness.copter_flight import ACCEPTED, CopterFlight


def on_sensors(seed: int = 1) -> CopterFlight:
    return CopterFlight(feedback=Feedback.SENSORS, seed=seed)


def off_m(flight: CopterFlight) -> float:
    """How far the estimate is off the truth."""
    assert flight.estimate is not None
    return dist(flight.estimate.frame.position_enu_m, flight.position)


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_it_takes_off_goes_somewhere_and_lands(seed: int) -> None:
    flight = on_sensors(seed)
    flight.takeoff(5.0)
    assert flight.goto(10.0, 5.0, 8.0) == ACCEPTED
    flight.run(12.0)
    assert flight.position == pytest.approx((10.0, 5.0, 8.0), abs=1.0)
    assert flight.select(Mode.LAND) == ACCEPTED
    flight.wait_until(lambda: not flight.armed, within=30.0, what="the landing")
    assert abs(flight.position[2]) < 0.01
    assert flight.copter.pilot.ground.standing


def test_telemetry_tells_what_the_sensors_measure() -> None:
    flight = on_sensors()
    flight.takeoff(3.0)
    flight.client.forget()
    for name in ("HIGHRES_IMU", "GPS_RAW_INT", "ESTIMATOR_STATUS"):
        number = getattr(mav, f"MAVLINK_MSG_ID_{name}")
        assert flight.command(mav.MAV_CMD_REQUEST_MESSAGE, float(number)) == ACCEPTED
    flight.run(0.1)
    imu, gps, status = (flight.client.latest(name) for name in ("HIGHRES_IMU", "GPS_RAW_INT", "ESTIMATOR_STATUS"))
    assert imu.zacc == pytest.approx(-9.81, abs=0.5)
    assert imu.zacc != -9.81
    assert hypot(imu.xmag, imu.ymag, imu.zmag) == pytest.approx(0.48, abs=0.03)
    assert gps.fix_type == 3
    assert gps.satellites_visible > 3
    assert status.flags & mav.ESTIMATOR_POS_HORIZ_ABS
    assert 0.0 < status.pos_horiz_accuracy < 1.0
    assert 0.0 < status.vel_ratio < 1.0


@pytest.mark.long
def test_lost_gps_is_said_and_survived() -> None:
    """20 s without: it drifts a little, says so, and goes back without a jump."""
    flight = on_sensors()
    flight.set_param("SYS_FAILURE_EN", 1)
    flight.takeoff(10.0)
    flight.run(20.0)
    before = flight.position
    off, ok = float(mav.FAILURE_TYPE_OFF), float(mav.FAILURE_TYPE_OK)
    gps = float(mav.FAILURE_UNIT_SENSOR_GPS)
    assert flight.command(mav.MAV_CMD_INJECT_FAILURE, gps, off) == ACCEPTED
    flight.run(20.0)
    assert flight.client.said("GPS lost: position by dead reckoning")
    assert dist(flight.position, before) < 20.0
    assert flight.mode is Mode.HOLD
    assert flight.command(mav.MAV_CMD_INJECT_FAILURE, gps, ok) == ACCEPTED
    max_rate = 0.0
    for _ in range(150):
        flight.run(0.1)
        max_rate = max(max_rate, hypot(*flight.velocity))
    assert flight.client.said("GPS lost: cleared")
    assert max_rate < 1.0
    assert off_m(flight) < 1.0
    assert dist(flight.position, before) < 1.0


def test_it_does_not_arm_without_knowing_where_it_is() -> None:
    flight = on_sensors()
    flight.set_param("SYS_FAILURE_EN", 1)
    flight.command(mav.MAV_CMD_INJECT_FAILURE, float(mav.FAILURE_UNIT_SENSOR_GPS), float(mav.FAILURE_TYPE_OFF))
    flight.run(5.0)
    assert flight.arm() != ACCEPTED
    assert flight.client.said("position not known")
