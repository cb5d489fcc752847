"""Criteria of ArduPilot's tests of modes, missions and guided flight."""

from math import degrees, dist, hypot, isclose, nan

from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.autopilot.identities.copter_words import (
    ACCEPTED,
    AUTO,
    GLOBAL,
    LOCAL,
    RELATIVE,
    ground_speed,
    heading,
    height,
    home_and_disarmed,
    in_auto,
    near_angle,
    radio,
    rtl,
    says,
    shown,
    speeds,
    steered,
    upload,
)
from tests.support.flying import latest


def takeoff_heights(sitl: Sitl) -> None:
    sitl.takeoff(5.0)
    sitl.hold(lambda: 4.5 <= height(sitl) <= 5.5, for_=5.0, what="height")
    rtl(sitl)
    higher = latest(sitl, "HOME_POSITION")
    sitl.select("GUIDED")
    sitl.arm()
    z = higher.altitude * 1e-3 + 20.0
    sitl.gcs.order_int(mav.MAV_CMD_DO_SET_HOME, frame=GLOBAL, x=higher.latitude, y=higher.longitude, z=z)
    assert sitl.gcs.order_int(mav.MAV_CMD_NAV_TAKEOFF, frame=RELATIVE, x=0, y=0, z=5.0) == ACCEPTED
    sitl.wait_until(lambda: abs(height(sitl) - 25.0) < 0.4, within=40.0)
    sitl.hold(lambda: abs(height(sitl) - 25.0) <= 0.5, for_=5.0, what="height above home")


def condition_yaw(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    for angle, rate, way, relative, target in (
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (60.0, 0.0, 1.0, 1.0, 60.0),
        (60.0, 2.0, -1.0, 1.0, 0.0),
    ):
        assert sitl.command(mav.MAV_CMD_CONDITION_YAW, angle, rate, way, relative) == ACCEPTED
        limit = 11.0 if not rate else rate + 0.5
        while not near_angle(heading(sitl), target, 2.0):
            sitl.step()
            assert not rate or abs(degrees(sitl.rates[2])) < limit, "it turns as slowly as it was told"
            assert sitl.time_us < 120e6
        sitl.hold(lambda target=target: near_angle(heading(sitl), target, 5.0), for_=2.0, what="heading")  # type: ignore[misc]


def alt_hold(sitl: Sitl) -> None:
    sitl.takeoff(10.0)
    steered(sitl, 1.0, c3=1500)
    sitl.select("ALT_HOLD")
    for tilt in (1500, 1000):
        for _ in range(10):
            radio(sitl, c1=tilt, c2=tilt, c3=1500)
            sitl.hold(lambda: 9.0 <= height(sitl) <= 11.0, for_=0.5, what="height")


def loiter(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    steered(sitl, 0.5, c3=1500)
    sitl.select("LOITER")
    steered(sitl, 8.0, c2=1100, c3=1500)
    steered(sitl, 4.0, c2=1500, c3=1500)
    assert ground_speed(sitl) < 2.0
    place = sitl.position
    for _ in range(20):
        radio(sitl, c3=1500)
        sitl.hold(lambda: dist(sitl.position, place) < 5.0, for_=0.5, what="place")
    steered(sitl, 6.0, c3=1800)
    assert height(sitl) > 25.0
    steered(sitl, 4.0, c3=1200)
    rtl(sitl)


def brake(sitl: Sitl) -> None:
    sitl.takeoff(10.0)
    velocity(sitl, 8.0, 0.0, 0.0)
    sitl.wait_until(lambda: ground_speed(sitl) > 5.0, within=20.0)
    sitl.select("BRAKE")
    sitl.wait_until(lambda: ground_speed(sitl) < 1.0, within=10.0)
    sitl.select("GUIDED")
    velocity(sitl, 0.0, 0.0, 1.0)
    sitl.wait_until(lambda: sitl.velocity[2] < -0.8, within=10.0)
    sitl.select("BRAKE")
    sitl.wait_until(lambda: abs(sitl.velocity[2]) < 0.05, within=10.0)


def velocity(sitl: Sitl, north: float, east: float, down: float, frame: int = LOCAL) -> None:
    sitl.send(
        *("SET_POSITION_TARGET_LOCAL_NED", 0, 1, 1, frame, 3527, 0.0, 0.0, 0.0, north, east, down),
        *(0.0, 0.0, 0.0, 0.0, 0.0),
    )


def takeoff_by_stick(sitl: Sitl) -> None:
    radio(sitl, c3=1000)
    sitl.select("POSHOLD")
    sitl.arm()
    steered(sitl, 2.0, c3=1000)
    assert height(sitl) <= 0.1
    steered(sitl, 0.5, c3=1710)
    assert height(sitl) <= 2.0
    steered(sitl, 8.0, c3=1500)
    for _ in range(20):
        radio(sitl, c3=1500)
        sitl.hold(lambda: 6.9 <= height(sitl) <= 8.0, for_=0.5, what="height")


def without_gps(sitl: Sitl) -> None:
    """Take off and climb by attitude and thrust alone, as DroneKit's set_attitude_target does."""
    sitl.select("GUIDED_NOGPS")
    sitl.arm()

    def climbs(thrust: float, seconds: float) -> None:
        for _ in range(round(10 * seconds)):
            sitl.send("SET_ATTITUDE_TARGET", 0, 1, 1, 0b100, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, thrust)
            sitl.run(0.1)

    climbs(0.7, 6.0)
    assert isclose(sitl.velocity[2], 1.0, abs_tol=0.05)
    climbs(0.6, 3.0)
    assert isclose(sitl.velocity[2], 0.5, abs_tol=0.05)
    sitl.run(5.0)
    assert abs(sitl.velocity[2]) < 0.05


def landing(sitl: Sitl) -> None:
    sitl.takeoff(25.0)
    sitl.select("LAND")
    sitl.wait_until(lambda: sitl.velocity[2] < -1.45, within=10.0)
    sitl.hold(lambda: abs(sitl.velocity[2] + 1.5) <= 0.1, for_=5.0, what="fast")
    sitl.wait_until(lambda: sitl.velocity[2] > -0.6, within=30.0)
    assert abs(height(sitl) - 10.0) < 1.5
    sitl.hold(lambda: abs(sitl.velocity[2] + 0.5) <= 0.1, for_=5.0, what="slow")
    home_and_disarmed(sitl)


def mission(sitl: Sitl) -> None:
    upload(
        sitl,
        items.takeoff(10.0),
        items.waypoint(0.0, 20.0, 10.0),
        items.Item(mav.MAV_CMD_CONDITION_YAW, (90.0, 0.0, 1.0, 0.0)),
        items.Item(mav.MAV_CMD_NAV_LOITER_TIME, (3.0, 0.0, 0.0, nan), (10.0, 20.0, 12.0)),
        items.jump(1, 1),
        items.return_home(),
    )
    in_auto(sitl)
    home_and_disarmed(sitl)
    says(sitl, "Mission: 6 RTL", 1.0)


def mission_start(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(25.0), items.return_home())
    sitl.select("AUTO")
    sitl.arm()
    sitl.run(3.0)
    assert height(sitl) < 0.2
    assert sitl.gcs.order_int(mav.MAV_CMD_MISSION_START, frame=RELATIVE, x=0, y=0) == ACCEPTED
    sitl.wait_until(lambda: height(sitl) > 20.0, within=40.0)


def nav_delay(sitl: Sitl) -> None:
    upload(
        sitl,
        items.takeoff(5.0),
        items.Item(mav.MAV_CMD_NAV_DELAY, (60.0, 0.0, 0.0, 0.0)),
        items.Item(mav.MAV_CMD_NAV_LAND),
    )
    in_auto(sitl)
    says(sitl, "Mission: 2 Delay", 30.0)
    began_us = sitl.time_us
    says(sitl, "Mission: 3 Land", 70.0)
    assert sitl.time_us - began_us >= 59e6
    home_and_disarmed(sitl)


def takeoff_below(sitl: Sitl) -> None:
    upload(
        sitl,
        items.takeoff(10.0),
        items.Item(mav.MAV_CMD_NAV_LOITER_TIME, (5.0, 0.0, 0.0, nan), (0.0, 0.0, 10.0)),
        items.return_home(),
    )
    sitl.takeoff(10.0)
    sitl.select("AUTO")
    sitl.hold(lambda: abs(height(sitl) - 10.0) < 1.0, for_=4.0, what="height")


def pause_mission(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(10.0), items.waypoint(0.0, 80.0, 10.0), items.return_home())
    in_auto(sitl)
    sitl.wait_until(lambda: ground_speed(sitl) > 4.0, within=60.0)
    for _ in range(2):
        assert sitl.command(mav.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    sitl.wait_until(lambda: ground_speed(sitl) < 1.0, within=10.0)
    sitl.hold(lambda: ground_speed(sitl) <= 1.0, for_=5.0, what="pause")
    assert shown(sitl) == AUTO
    for _ in range(2):
        assert sitl.command(mav.MAV_CMD_DO_PAUSE_CONTINUE, 1.0) == ACCEPTED
    sitl.wait_until(lambda: ground_speed(sitl) > 4.0, within=20.0)
    home_and_disarmed(sitl)


def pause_guided(sitl: Sitl) -> None:
    sitl.takeoff(10.0)
    sitl.goto(0.0, 300.0, 10.0, wait=False)
    sitl.wait_until(lambda: ground_speed(sitl) > 5.0, within=20.0)
    for moves in (False, True):
        if moves:
            velocity(sitl, 5.0, 5.0, 0.0)
        sitl.wait_until(lambda: ground_speed(sitl) > 5.0, within=20.0)
        assert sitl.command(mav.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
        sitl.wait_until(lambda: ground_speed(sitl) < 1.0, within=10.0)
        sitl.hold(lambda: ground_speed(sitl) <= 1.0, for_=5.0, what="pause")
        assert sitl.command(mav.MAV_CMD_DO_PAUSE_CONTINUE, 1.0) == ACCEPTED
        sitl.wait_until(lambda: ground_speed(sitl) > 5.0, within=20.0)


def speeds_in_mission(sitl: Sitl) -> None:
    legs = []
    for place, speed in ((60.0, 4.0), (500.0, 15.0), (150.0, 10.0)):
        legs += [items.change_speed(speed), items.waypoint(0.0, place, 20.0)]
    upload(sitl, items.takeoff(20.0), *legs, items.return_home())
    in_auto(sitl)
    speeds(sitl, 0.5, 4.0, 4.0, 15.0, 10.0)


def speeds_in_guided(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    sitl.goto(0.0, 2000.0, 20.0, wait=False)
    for speed in (2.0, 10.0, 4.0):
        assert sitl.command(mav.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed) == ACCEPTED
        speeds(sitl, 0.2, 10.0, speed)


def speed_parameters(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(20.0), items.waypoint(0.0, 2000.0, 20.0), items.return_home())
    in_auto(sitl)
    for speed in (7.0, 8.0, 11.0):
        sitl.set_param("WPNAV_SPEED", 100.0 * speed)
        speeds(sitl, 1.0, 4.0, speed)


def vertical_speed_parameters(sitl: Sitl) -> None:
    up, down = items.waypoint(0.0, 0.5, 120.0), items.waypoint(0.0, 0.0, 10.0)
    upload(sitl, items.takeoff(5.0), up, down, items.return_home())
    sitl.set_param("WPNAV_SPEED_UP", 800.0)
    sitl.set_param("WPNAV_SPEED_DN", 500.0)
    in_auto(sitl)
    says(sitl, "Mission: 2 WP", 30.0)
    for speed in (7.0, 6.0):
        sitl.set_param("WPNAV_SPEED_UP", 100.0 * speed)
        sitl.wait_until(lambda speed=speed: abs(sitl.velocity[2] - speed) < 1.0, within=40.0)  # type: ignore[misc]
        sitl.hold(lambda speed=speed: abs(sitl.velocity[2] - speed) < 1.0, for_=3.0, what=f"{speed} m/s")  # type: ignore[misc]
    sitl.wait_until(lambda: sitl.velocity[2] < -4.0, within=60.0)
    sitl.hold(lambda: abs(sitl.velocity[2] + 5.0) < 1.0, for_=4.0, what="descent")


def guided_submodes(sitl: Sitl) -> None:
    sitl.takeoff(10.0)
    for angle in (45.0, 135.0):
        sitl.command(mav.MAV_CMD_CONDITION_YAW, angle)
        sitl.wait_until(lambda angle=angle: near_angle(heading(sitl), angle, 1.0), within=20.0)  # type: ignore[misc]
    sitl.send("SET_POSITION_TARGET_LOCAL_NED", 0, 1, 1, LOCAL, 3576, 5.0, 5.0, -10.0, *(0.0,) * 8)
    sitl.wait_until(lambda: dist(sitl.position, (5.0, 5.0, 10.0)) < 1.0, within=20.0)
    assert near_angle(heading(sitl), 135.0, 1.5)
    target = latest(sitl, "POSITION_TARGET_LOCAL_NED")
    assert dist((target.x, target.y, target.z), (5.0, 5.0, -10.0)) < 0.01
    assert target.type_mask & 0xFFF == 3576 & 0xFFF
    sitl.select("LOITER")
    sitl.run(0.1)
    number = float(mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED)
    assert sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, number) != ACCEPTED


def global_positions(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    home = latest(sitl, "HOME_POSITION")
    above_sea_m = home.altitude * 1e-3 + 20.0
    for frame, up in ((0, above_sea_m), (5, above_sea_m), (3, 20.0), (6, 20.0), (11, 20.0)):
        x, y = home.latitude + 500, home.longitude
        sitl.send("SET_POSITION_TARGET_GLOBAL_INT", 0, 1, 1, frame, 3576, x, y, up, *(0.0,) * 8)
        sitl.wait_until(lambda: dist(sitl.position, (0.0, 5.56, 20.0)) < 2.0, within=20.0)
        sitl.send("SET_POSITION_TARGET_GLOBAL_INT", 0, 1, 1, frame, 3576, home.latitude, y, up, *(0.0,) * 8)
        sitl.wait_until(lambda: dist(sitl.position, (0.0, 0.0, 20.0)) < 2.0, within=20.0)
    for yaw in (42.0, 0.0):
        mask, where = 0b100111111000, (home.latitude, home.longitude, 20.0)
        sitl.send("SET_POSITION_TARGET_GLOBAL_INT", 0, 1, 1, 6, mask, *where, *(0.0,) * 6, yaw * 0.0174533, 0.0)
        sitl.wait_until(lambda yaw=yaw: near_angle(heading(sitl), yaw), within=10.0)  # type: ignore[misc]
        sitl.hold(lambda yaw=yaw: near_angle(heading(sitl), yaw), for_=5.0, what="heading")  # type: ignore[misc]


def velocities(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    for north, east, down in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, -1.0, -1.0)):
        velocity(sitl, north, east, down)
        wanted = (east, north, -down)
        sitl.wait_until(lambda wanted=wanted: dist(sitl.velocity, wanted) < 0.3, within=3.0)  # type: ignore[misc]
        velocity(sitl, north, east, down)
        sitl.hold(lambda wanted=wanted: dist(sitl.velocity, wanted) < 0.5, for_=2.0, what="velocity")  # type: ignore[misc]
    for frame in (0, 3, 5, 6, 10, 11):
        for north in (1.0, -1.0):
            target = (0, 1, 1, frame, 3527, 0, 0, 0.0, north, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            sitl.send("SET_POSITION_TARGET_GLOBAL_INT", *target)
            wanted = (0.0, north, 0.0)
            sitl.wait_until(lambda wanted=wanted: dist(sitl.velocity, wanted) < 0.3, within=5.0)  # type: ignore[misc]
    bad = (0, 1, 1, 6, 3527, 0, 0, 0.0, 1.0, -3.6e30, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    sitl.send("SET_POSITION_TARGET_GLOBAL_INT", *bad)
    sitl.wait_until(lambda: hypot(*sitl.velocity) < 0.3, within=2.5)
    velocity(sitl, 1.0, 0.0, 0.0)
    sitl.run(1.0)
    velocity(sitl, 1.0, -3.6e30, 0.0)
    sitl.wait_until(lambda: hypot(*sitl.velocity) < 0.3, within=5.0)
    sitl.hold(lambda: hypot(*sitl.velocity) < 0.3, for_=10.0, what="standing")


def guided_thrust(sitl: Sitl) -> None:
    sitl.takeoff(5.0)
    end = sitl.time_us + 10_000_000
    while sitl.time_us < end:
        sitl.send("SET_ATTITUDE_TARGET", 0, 1, 1, 7, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.5)
        sitl.run(0.2)
    assert height(sitl) > 5.5
