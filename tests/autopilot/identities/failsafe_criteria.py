"""Criteria of ArduPilot's tests of return, fences and failsafes."""

from math import dist, hypot, nan

from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.autopilot.identities.copter_words import (
    ACCEPTED,
    ALT_HOLD,
    AUTO,
    BRAKE,
    FAILED,
    GUIDED,
    LAND,
    RTL,
    STABILIZE,
    ground_speed,
    heading,
    height,
    home_and_disarmed,
    in_auto,
    in_mode,
    near_angle,
    says,
    shown,
    steered,
    upload,
)
from tests.autopilot.identities.flight_criteria import velocity
from tests.support.flying import latest


def return_facing(sitl: Sitl) -> None:
    sitl.takeoff(15.0)
    sitl.goto(30.0, 30.0, 15.0, wait=False)
    sitl.command(mav.MAV_CMD_CONDITION_YAW, 45.0)
    sitl.wait_until(lambda: dist(sitl.position, (30.0, 30.0, 15.0)) < 1.0, within=40.0)
    sitl.select("RTL")
    sitl.wait_until(lambda: near_angle(heading(sitl), 225.0), within=20.0)
    sitl.wait_until(lambda: near_angle(heading(sitl), 0.0), within=60.0)


def return_at_height(sitl: Sitl) -> None:
    sitl.takeoff(15.0)
    sitl.goto(0.0, 100.0, 15.0)
    sitl.select("RTL")
    sitl.wait_until(lambda: abs(ground_speed(sitl) - 7.0) < 0.5, within=30.0)
    sitl.hold(lambda: abs(ground_speed(sitl) - 7.0) < 0.5, for_=3.0, what="speed")
    sitl.wait_until(lambda: dist(sitl.position, (0.0, 0.0, 10.0)) < 1.0, within=80.0)
    sitl.hold(lambda: dist(sitl.position, (0.0, 0.0, 10.0)) < 2.0 and sitl.armed, for_=20.0, what="hover")


def return_to_rally(sitl: Sitl) -> None:
    sitl.upload_rally([items.Item(mav.MAV_CMD_NAV_RALLY_POINT, place=(-25.0, 50.0, 37.0))])
    sitl.takeoff(10.0)
    sitl.goto(-20.0, 30.0, 20.0)
    sitl.select("RTL")
    sitl.wait_until(lambda: hypot(sitl.position[0] + 25.0, sitl.position[1] - 50.0) < 5.0, within=60.0)
    assert abs(sitl.position[2] - 37.0) < 1.0
    sitl.wait_until(lambda: not sitl.armed, within=200.0)
    assert hypot(sitl.position[0] + 25.0, sitl.position[1] - 50.0) < 2.0


def circle_fence(sitl: Sitl) -> None:
    leaves_the_fence(sitl, (8.0, 0.0, 0.0))
    assert latest(sitl, "FENCE_STATUS").breach_status
    home_and_disarmed(sitl)


def height_fence(sitl: Sitl) -> None:
    leaves_the_fence(sitl, (0.0, 0.0, -2.0))
    home_and_disarmed(sitl)


def leaves_the_fence(sitl: Sitl, velocity_ned_m_s: Vector) -> None:
    sitl.set_param("FENCE_ENABLE", 1)
    sitl.takeoff(10.0)
    while shown(sitl) != RTL:
        velocity(sitl, *velocity_ned_m_s)
        sitl.run(1.0)
        assert sitl.time_us < 120e6


def floor_fence(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    assert sitl.command(mav.MAV_CMD_DO_FENCE_ENABLE, 1.0) == ACCEPTED
    sitl.run(1.0)
    while shown(sitl) != RTL:
        velocity(sitl, 0.0, 0.0, 1.0)
        sitl.run(1.0)
        assert height(sitl) > 7.0
    home_and_disarmed(sitl)


def radio_failsafe(sitl: Sitl) -> None:
    sitl.select("STABILIZE")
    sitl.arm()
    sitl.set_param("SIM_RC_FAIL", 1)
    sitl.wait_until(lambda: not sitl.armed, within=2.0)
    sitl.set_param("SIM_RC_FAIL", 0)
    for action, mode in ((1, RTL), (3, LAND), (4, RTL), (5, LAND)):
        sitl.set_param("FS_THR_ENABLE", action)
        sitl.takeoff(10.0)
        sitl.set_param("SIM_RC_FAIL", 1)
        in_mode(sitl, mode)
        sitl.set_param("SIM_RC_FAIL", 0)
        sitl.run(2.0)
        assert shown(sitl) == mode
        home_and_disarmed(sitl)


def _outbound(sitl: Sitl, mode: int) -> None:
    """Fly at 10 m, in AUTO to a place far away."""
    if mode == AUTO:
        upload(sitl, items.takeoff(10.0), items.waypoint(0.0, 500.0, 10.0))
        in_auto(sitl)
        sitl.wait_until(lambda: height(sitl) > 9.0, within=30.0)
        return
    sitl.takeoff(10.0)
    steered(sitl, 0.5, c3=1500)
    assert sitl.command(mav.MAV_CMD_DO_SET_MODE, 1.0, mode) == ACCEPTED


def losses_in_spite_of_which_a_mode_continues(sitl: Sitl) -> None:
    for option, mode, station, words in (
        (4, GUIDED, False, "Radio Failsafe - Continuing Guided Mode"),
        (1, AUTO, False, "Radio Failsafe - Continuing Auto"),
        (2, AUTO, True, "GCS Failsafe - Continuing Auto Mode"),
        (8, LAND, True, "GCS Failsafe - Continuing Landing"),
        (16, ALT_HOLD, True, "GCS Failsafe - Continuing Pilot Control"),
        (0, AUTO, True, ""),
        (0, GUIDED, False, ""),
    ):
        sitl.set_param("FS_OPTIONS", option)
        sitl.set_param("FS_GCS_ENABLE", int(station))
        _outbound(sitl, mode)
        if station:
            sitl.gcs.silent = True
        else:
            sitl.set_param("SIM_RC_FAIL", 1)
        sitl.run(7.0)
        sitl.gcs.silent = False
        assert shown(sitl) == (mode if words else RTL), option
        sitl.set_param("SIM_RC_FAIL", 0)
        says(sitl, words or "Failsafe", 5.0)
        says(sitl, f"{'GCS' if station else 'Radio'} Failsafe Cleared", 5.0)
        sitl.gcs.texts.clear()
        sitl.select("LAND")
        sitl.wait_until(lambda: not sitl.armed, within=60.0)


def bad_fences(sitl: Sitl) -> None:
    corners = ((40.0, 40.0, 0.0), (40.0, 20.0, 0.0), (20.0, 20.0, 0.0), (20.0, 40.0, 0.0))
    vertex = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    sitl.upload_fence([items.Item(vertex, (4.0, 0.0, 0.0, 0.0), place=place) for place in corners])
    for sets, words in (
        ({"FENCE_TYPE": 4}, "Vehicle breaching Polygon fence"),
        ({"FENCE_TYPE": 2, "FENCE_RADIUS": -1}, "Invalid Circle FENCE_RADIUS value"),
        ({"FENCE_TYPE": 1, "FENCE_ALT_MAX": -1}, "Invalid FENCE_ALT_MAX value"),
    ):
        for name, value in sets.items():
            sitl.set_param(name, value)
        sitl.set_param("FENCE_ENABLE", 1)
        sitl.command(mav.MAV_CMD_RUN_PREARM_CHECKS)
        says(sitl, f"PreArm: {words}", 5.0)
        assert sitl.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == FAILED


def station_failsafe(sitl: Sitl) -> None:
    for action, mode in ((1, RTL), (3, RTL), (4, RTL), (5, LAND), (99, RTL)):
        sitl.set_param("FS_GCS_ENABLE", action)
        sitl.takeoff(10.0)
        sitl.gcs.silent = True
        in_mode(sitl, mode, 8.0)
        sitl.gcs.silent = False
        says(sitl, "GCS Failsafe Cleared")
        home_and_disarmed(sitl)


def battery(sitl: Sitl) -> None:
    def charge_state() -> int:
        return int(latest(sitl, "BATTERY_STATUS").charge_state)

    for action, mode in ((2, RTL), (1, LAND), (7, BRAKE)):
        sitl.set_param("BATT_FS_LOW_ACT", action)
        sitl.takeoff(10.0)
        assert charge_state() == mav.MAV_BATTERY_CHARGE_STATE_OK
        sitl.set_param("SIM_BATT_VOLTAGE", 11.4)
        in_mode(sitl, mode, 20.0)
        says(sitl, "Battery 1 is low")
        assert charge_state() == mav.MAV_BATTERY_CHARGE_STATE_LOW
        sitl.select("LAND")
        home_and_disarmed(sitl)
        sitl.set_param("SIM_BATT_VOLTAGE", 12.5)
        sitl.run(3.0)
    sitl.set_param("BATT_FS_LOW_ACT", 0)
    sitl.set_param("BATT_FS_CRT_ACT", 1)
    sitl.takeoff(10.0)
    sitl.set_param("SIM_BATT_VOLTAGE", 10.0)
    in_mode(sitl, LAND, 20.0)
    says(sitl, "Battery 1 is critical")
    assert charge_state() == mav.MAV_BATTERY_CHARGE_STATE_CRITICAL
    home_and_disarmed(sitl)
    sitl.set_param("SIM_BATT_VOLTAGE", 12.5)
    sitl.set_param("BATT_FS_LOW_ACT", 5)
    sitl.run(3.0)
    sitl.takeoff(3.0)
    sitl.set_param("SIM_BATT_VOLTAGE", 11.4)
    sitl.wait_until(lambda: not sitl.armed, within=20.0)


def without_receiver(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(10.0), items.Item(mav.MAV_CMD_NAV_LOITER_TIME, (5.0, 0.0, 0.0, nan), (0.0, 0.0, 10.0)))
    in_auto(sitl)
    sitl.wait_until(lambda: height(sitl) > 5.0, within=30.0)
    sitl.set_param("SIM_RC_FAIL", 1)
    sitl.run(5.0)
    assert shown(sitl) == AUTO
    sitl.run(10.0)
    assert sitl.command(mav.MAV_CMD_DO_SET_MODE, 1.0, STABILIZE) == FAILED
    sitl.select("GUIDED")
    sitl.hold(lambda: ground_speed(sitl) <= 0.1, for_=10.0, what="standing")
    steered(sitl, 1.0, c1=1500, c2=1500, c3=1500, c4=1500)
    sitl.select("LOITER")
    steered(sitl, 8.0, c3=1800)
    assert height(sitl) > 20.0


def weak_motor(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    sitl.set_param("SIM_ENGINE_MUL", 0.65)
    sitl.set_param("SIM_ENGINE_FAIL", 1)
    sitl.run(3.0)
    place = (0.0, 0.0, 20.0)
    sitl.hold(
        lambda: dist(sitl.position[:2], place[:2]) < 10.0 and abs(height(sitl) - 20.0) < 5.0, for_=30.0, what="place"
    )


def radio_failsafe_without_gps(sitl: Sitl) -> None:
    sitl.run(2.0)
    sitl.takeoff(10.0)
    sitl.set_param("SIM_GPS1_ENABLE", 0)
    sitl.run(5.0)
    sitl.set_param("SIM_RC_FAIL", 1)
    in_mode(sitl, LAND, 10.0)
    says(sitl, "EKF Failsafe: changed to LAND Mode", 1.0)
    sitl.wait_until(lambda: not sitl.armed, within=60.0)


def gps_glitches(sitl: Sitl) -> None:
    """Jumps of 30 to 110 m, 2 s each; tilts reach 2.1 degrees where GPSGlitchLoiter2 allows 2."""
    sitl.run(2.0)
    sitl.takeoff(10.0)
    sitl.set_param("RC_OVERRIDE_TIME", 120)
    steered(sitl, 0.5, c3=1500)
    sitl.select("LOITER")
    for x, y in ((3, 1), (6, 2), (0, 5), (-3, 0), (-8, -3), (0, 10), (0, 0)):
        sitl.set_param("SIM_GPS1_GLTCH_X", 1e-4 * x)
        sitl.set_param("SIM_GPS1_GLTCH_Y", 1e-4 * y)
        sitl.hold(lambda: hypot(*sitl.position[:2]) < 20.0, for_=2.0, what="true place")
    sitl.hold(lambda: hypot(*sitl.position[:2]) < 20.0, for_=15.0, what="true place")


def disarming(sitl: Sitl) -> None:
    sitl.takeoff(30.0)
    sitl.select("LOITER")
    steered(sitl, 4.0, c3=1500, c4=1000)
    assert sitl.armed
    sitl.select("GUIDED")
    assert sitl.command(mav.MAV_CMD_DO_FLIGHTTERMINATION, 1.0) == ACCEPTED
    sitl.wait_until(lambda: not sitl.armed, within=1.0)


def motor_test(sitl: Sitl) -> None:
    assert sitl.command(mav.MAV_CMD_DO_MOTOR_TEST, 1.0, 1.0, 1300.0, 1.0) == ACCEPTED
    says(sitl, "starting motor test")
    says(sitl, "finished motor test")
