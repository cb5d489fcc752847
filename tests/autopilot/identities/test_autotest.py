"""ArduPilot's own tests, as flights of identity `ardupilot` with their criteria.

Each row names the tests of ArduPilot's autotest whose criteria it has (Tools/autotest/arducopter.py and
vehicle_test_suite.py, ArduCopter 4.7.0-dev of July 2025, 90700977); parameters have the names of 4.6.
"""

from collections.abc import Callable, Mapping
from math import degrees, dist, hypot, isclose, nan
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest

from colibri.common.earth.geodesy import geodetic_of
from colibri.mavlink.mission.items import FENCE, MISSION
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl

ACCEPTED, DENIED, FAILED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED, mav.MAV_RESULT_FAILED
GLOBAL, RELATIVE = mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
LOCAL = mav.MAV_FRAME_LOCAL_NED
STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, LAND, BRAKE = 0, 2, 3, 4, 5, 6, 7, 9, 17
STANDARD = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800)
Check = Callable[[Sitl], object]


def latest(sitl: Sitl, name: str) -> Any:
    """Request a message and return it."""
    before = len(sitl.gcs.heard[name])
    sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, getattr(mav, f"MAVLINK_MSG_ID_{name}"))
    sitl.wait_until(lambda: len(sitl.gcs.heard[name]) > before, within=5.0, what=name)
    return sitl.gcs.latest(name)


def shown(sitl: Sitl) -> int:
    return int(sitl.gcs.latest("HEARTBEAT").custom_mode)


def in_mode(sitl: Sitl, number: int, within: float = 5.0) -> None:
    sitl.wait_until(lambda: shown(sitl) == number, within=within, what=f"mode {number}")


def says(sitl: Sitl, words: str, within: float = 20.0) -> None:
    sitl.wait_until(lambda: any(words in text for text in sitl.gcs.texts), within=within, what=words)


def both(sitl: Sitl, number: int, *params: float, z: float = 0.0) -> tuple[int, int]:
    """Send a command as COMMAND_LONG and as COMMAND_INT."""
    p = (*params, *(0.0,) * (4 - len(params)))
    return (
        sitl.gcs.order(number, *p, 0.0, 0.0, z),
        sitl.gcs.order_int(number, *p, frame=RELATIVE, x=0, y=0, z=z),
    )


def held(sitl: Sitl, fact: Callable[[], bool], seconds: float, what: str = "") -> None:
    """Fly on while a fact holds."""
    end = sitl.time_us + round(seconds * 1e6)
    while sitl.time_us < end:
        sitl.step()
        assert fact(), f"{what} at {sitl.time_us * 1e-6:.1f} s: {sitl.position} {sitl.velocity}"


def reaches(sitl: Sitl, fact: Callable[[], bool], seconds: float, within: float, what: str) -> None:
    """Fly on until a fact has held for some time."""
    since_us = sitl.time_us
    end = sitl.time_us + round(within * 1e6)
    while sitl.time_us - since_us < seconds * 1e6:
        sitl.step()
        assert sitl.time_us < end, f"{what} for {seconds} s: {sitl.position} {sitl.velocity}"
        if not fact():
            since_us = sitl.time_us


def speeds(sitl: Sitl, tolerance: float, seconds: float, *wanted: float) -> None:
    for speed in wanted:
        near = lambda speed=speed: abs(ground_speed(sitl) - speed) < tolerance  # noqa: E731
        reaches(sitl, near, seconds, 60.0, f"{speed} m/s")


def radio(sitl: Sitl, **channels: int) -> None:
    """Override channels, as c3=1500."""
    values = [channels.get(f"c{number}", 65535) for number in range(1, 9)]
    more = [channels.get(f"c{number}", 0) for number in range(9, 19)]
    sitl.send("RC_CHANNELS_OVERRIDE", 1, 1, *values, *more)


def steered(sitl: Sitl, seconds: float, **channels: int) -> None:
    for _ in range(round(seconds * 2)):
        radio(sitl, **channels)
        sitl.run(0.5)


def height(sitl: Sitl) -> float:
    return sitl.position[2]


def ground_speed(sitl: Sitl) -> float:
    return hypot(*sitl.velocity[:2])


def heading(sitl: Sitl) -> float:
    """Return the heading, degrees clockwise from north."""
    return (90.0 - degrees(sitl.euler[2])) % 360.0


def near_angle(a: float, b: float, tolerance: float = 5.0) -> bool:
    return abs((a - b + 180.0) % 360.0 - 180.0) <= tolerance


def home_and_disarmed(sitl: Sitl, within: float = 250.0) -> None:
    sitl.wait_until(lambda: not sitl.armed, within=within, what="the landing")
    assert height(sitl) < 1.0
    assert hypot(*sitl.position[:2]) < 10.0


def rtl(sitl: Sitl) -> None:
    sitl.select("RTL")
    home_and_disarmed(sitl)


def upload(sitl: Sitl, *plan: items.Item) -> None:
    sitl.upload_mission(plan)


def in_auto(sitl: Sitl) -> None:
    sitl.select("AUTO")
    sitl.arm()
    sitl.gcs.command(mav.MAV_CMD_MISSION_START)


# On the ground.


def commands_change_modes(sitl: Sitl) -> None:
    for number, mode in ((20, RTL), (17, LOITER), (85, LAND), (21, LAND)):
        for send in (sitl.gcs.order, lambda n: sitl.gcs.order_int(n, frame=RELATIVE, x=0, y=0)):
            sitl.select("STABILIZE")
            in_mode(sitl, STABILIZE)
            assert send(number) == ACCEPTED
            in_mode(sitl, mode)


def capabilities(sitl: Sitl) -> None:
    has = latest(sitl, "AUTOPILOT_VERSION").capabilities
    assert has & mav.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    assert has & mav.MAV_PROTOCOL_CAPABILITY_COMPASS_CALIBRATION


def index_validity(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(5.0), items.waypoint(0.0, 5.0, 5.0), items.return_home())
    for seq, result in ((0, ACCEPTED), (1, ACCEPTED), (3, ACCEPTED), (-1, DENIED), (4, DENIED)):
        assert sitl.command(mav.MAV_CMD_DO_SET_MISSION_CURRENT, float(seq)) == result, seq


def jump_tags(sitl: Sitl) -> None:
    assert sitl.command(mav.MAV_CMD_DO_JUMP_TAG, 65535.0) == FAILED
    assert sitl.command(mav.MAV_CMD_DO_JUMP_TAG, 65536.0) == DENIED


def mission_start_parameters(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(5.0), items.return_home())
    for params in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        assert both(sitl, mav.MAV_CMD_MISSION_START, *params) == (DENIED, DENIED)


def no_arming_without_items(sitl: Sitl) -> None:
    sitl.select("AUTO")
    sitl.command(mav.MAV_CMD_RUN_PREARM_CHECKS)
    says(sitl, "PreArm: Mode requires mission", 5.0)
    assert sitl.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == FAILED


def parameter_validation(sitl: Sitl) -> None:
    for changes, words in (
        ({"MOT_PWM_MIN": 1800, "MOT_PWM_MAX": 1500}, "Check MOT_PWM_MIN and MOT_PWM_MAX"),
        ({"MOT_SPIN_MIN": 0.5}, "MOT_SPIN_MIN too high 0.50 > 0.3"),
        ({"MOT_SPIN_ARM": 0.2, "MOT_SPIN_MIN": 0.1}, "MOT_SPIN_ARM > MOT_SPIN_MIN"),
    ):
        before = {name: sitl.get_param(name) for name in changes}
        for name, value in changes.items():
            sitl.set_param(name, value)
        sitl.command(mav.MAV_CMD_RUN_PREARM_CHECKS)
        says(sitl, words)
        for name, value in before.items():
            sitl.set_param(name, value)


def set_home(sitl: Sitl) -> None:
    def home() -> Any:
        return latest(sitl, "HOME_POSITION")

    first = home()
    start = sitl.origin
    assert abs(first.latitude * 1e-7 - start.latitude_deg) < 6e-6
    assert abs(first.altitude * 1e-3 - start.altitude_m) < 2.0
    x, y, z = first.latitude + 1000, first.longitude + 2000, first.altitude * 1e-3 + 300.0
    assert sitl.gcs.order_int(mav.MAV_CMD_DO_SET_HOME, frame=GLOBAL, x=x, y=y, z=z) == ACCEPTED
    sitl.run(10.0)
    moved = home()
    assert (abs(moved.latitude - x), abs(moved.longitude - y)) <= (1, 1)
    assert abs(moved.altitude * 1e-3 - z) < 0.1
    for params in ((1.0,), (0.0,)):
        assert sitl.gcs.order_int(mav.MAV_CMD_DO_SET_HOME, *params, frame=GLOBAL, x=0, y=0) == ACCEPTED
        sitl.run(0.2)
        back = home()
        assert dist((back.latitude, back.longitude), (first.latitude, first.longitude)) < 100
        sitl.gcs.order_int(mav.MAV_CMD_DO_SET_HOME, frame=GLOBAL, x=x, y=y, z=z)


def aux_switches(sitl: Sitl) -> None:
    steered(sitl, 1.0, c5=1500, c9=1000, c10=1000)
    in_mode(sitl, CIRCLE)
    for channel, mode in (("c9", LAND), ("c10", GUIDED)):
        steered(sitl, 1.0, **{channel: 1900})
        in_mode(sitl, mode)
        steered(sitl, 1.0, **{channel: 1000})
        in_mode(sitl, CIRCLE)


def no_radio(sitl: Sitl) -> None:
    for fails, words in ((1, "RC not found"), (2, "Throttle below failsafe")):
        sitl.set_param("SIM_RC_FAIL", fails)
        sitl.run(0.5)
        sitl.command(mav.MAV_CMD_RUN_PREARM_CHECKS)
        says(sitl, words)
        assert sitl.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == FAILED


def reboot(sitl: Sitl) -> None:
    assert sitl.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0) == ACCEPTED
    sitl.run(3.0)


def initial_mode(sitl: Sitl) -> None:
    sitl.set_param("INITIAL_MODE", LAND)
    sitl.set_param("SIM_RC_FAIL", 1)
    starts = sitl.get_param("STAT_BOOTCNT")
    reboot(sitl)
    in_mode(sitl, LAND)
    assert sitl.get_param("STAT_BOOTCNT") == starts + 1
    sitl.set_param("SIM_RC_FAIL", 0)
    in_mode(sitl, STABILIZE)


def mission_at_boot(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(5.0), items.waypoint(0.0, 5.0, 5.0), items.return_home())
    for option, count in ((0, 4), (1, 0)):
        sitl.set_param("MIS_OPTIONS", option)
        reboot(sitl)
        before = len(sitl.gcs.heard["MISSION_COUNT"])
        sitl.send("MISSION_REQUEST_LIST", 1, 1, MISSION)
        sitl.wait_until(lambda before=before: len(sitl.gcs.heard["MISSION_COUNT"]) > before, within=5.0)  # type: ignore[misc]
        assert sitl.gcs.latest("MISSION_COUNT").count == count


def fence_by_old_items(sitl: Sitl) -> None:
    corners = [(40.0, 40.0), (40.0, -40.0), (-40.0, -40.0), (-40.0, 40.0)]
    places = [geodetic_of((east, north, 0.0), sitl.origin) for east, north in corners]
    sitl.send("MISSION_COUNT", 1, 1, len(places), FENCE)
    number = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    for seq, place in enumerate(places):
        sitl.wait_until(lambda: len(sitl.gcs.heard["MISSION_REQUEST"]) > seq, within=5.0)  # noqa: B023
        numbers = (4.0, 0.0, 0.0, 0.0, place.latitude_deg, place.longitude_deg, 0.0)
        sitl.send("MISSION_ITEM", 1, 1, seq, GLOBAL, number, 0, 1, *numbers, FENCE)
    sitl.wait_until(lambda: sitl.gcs.heard["MISSION_ACK"], within=5.0)
    sitl.send("MISSION_REQUEST_LIST", 1, 1, FENCE)
    sitl.wait_until(lambda: sitl.gcs.heard["MISSION_COUNT"], within=5.0)
    assert sitl.gcs.latest("MISSION_COUNT").count == len(places)
    for seq, place in enumerate(places):
        sitl.send("MISSION_REQUEST_INT", 1, 1, seq, FENCE)
        sitl.run(0.2)
        item = sitl.gcs.latest("MISSION_ITEM_INT")
        assert (item.seq, item.command, item.param1) == (seq, number, 4.0)
        assert isclose(item.x * 1e-7, place.latitude_deg, abs_tol=0.01)


# In the air.


def takeoff_heights(sitl: Sitl) -> None:
    sitl.takeoff(5.0)
    held(sitl, lambda: 4.5 <= height(sitl) <= 5.5, 5.0, "height")
    rtl(sitl)
    higher = latest(sitl, "HOME_POSITION")
    sitl.select("GUIDED")
    sitl.arm()
    z = higher.altitude * 1e-3 + 20.0
    sitl.gcs.order_int(mav.MAV_CMD_DO_SET_HOME, frame=GLOBAL, x=higher.latitude, y=higher.longitude, z=z)
    assert sitl.gcs.order_int(mav.MAV_CMD_NAV_TAKEOFF, frame=RELATIVE, x=0, y=0, z=5.0) == ACCEPTED
    sitl.wait_until(lambda: abs(height(sitl) - 25.0) < 0.4, within=40.0)
    held(sitl, lambda: abs(height(sitl) - 25.0) <= 0.5, 5.0, "height above home")


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
        held(sitl, lambda target=target: near_angle(heading(sitl), target, 5.0), 2.0, "heading")  # type: ignore[misc]


def alt_hold(sitl: Sitl) -> None:
    sitl.takeoff(10.0)
    steered(sitl, 1.0, c3=1500)
    sitl.select("ALT_HOLD")
    for tilt in (1500, 1000):
        for _ in range(10):
            radio(sitl, c1=tilt, c2=tilt, c3=1500)
            held(sitl, lambda: 9.0 <= height(sitl) <= 11.0, 0.5, "height")


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
        held(sitl, lambda: dist(sitl.position, place) < 5.0, 0.5, "place")
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
        held(sitl, lambda: 6.9 <= height(sitl) <= 8.0, 0.5, "height")


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
    held(sitl, lambda: abs(sitl.velocity[2] + 1.5) <= 0.1, 5.0, "fast")
    sitl.wait_until(lambda: sitl.velocity[2] > -0.6, within=30.0)
    assert abs(height(sitl) - 10.0) < 1.5
    held(sitl, lambda: abs(sitl.velocity[2] + 0.5) <= 0.1, 5.0, "slow")
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
    held(sitl, lambda: abs(height(sitl) - 10.0) < 1.0, 4.0, "height")


def pause_mission(sitl: Sitl) -> None:
    upload(sitl, items.takeoff(10.0), items.waypoint(0.0, 80.0, 10.0), items.return_home())
    in_auto(sitl)
    sitl.wait_until(lambda: ground_speed(sitl) > 4.0, within=60.0)
    for _ in range(2):
        assert sitl.command(mav.MAV_CMD_DO_PAUSE_CONTINUE, 0.0) == ACCEPTED
    sitl.wait_until(lambda: ground_speed(sitl) < 1.0, within=10.0)
    held(sitl, lambda: ground_speed(sitl) <= 1.0, 5.0, "pause")
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
        held(sitl, lambda: ground_speed(sitl) <= 1.0, 5.0, "pause")
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
        held(sitl, lambda speed=speed: abs(sitl.velocity[2] - speed) < 1.0, 3.0, f"{speed} m/s")  # type: ignore[misc]
    sitl.wait_until(lambda: sitl.velocity[2] < -4.0, within=60.0)
    held(sitl, lambda: abs(sitl.velocity[2] + 5.0) < 1.0, 4.0, "descent")


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
    for frame, up in (
        (0, home.altitude * 1e-3 + 20.0),
        (5, home.altitude * 1e-3 + 20.0),
        (3, 20.0),
        (6, 20.0),
        (11, 20.0),
    ):
        x, y = home.latitude + 500, home.longitude
        sitl.send("SET_POSITION_TARGET_GLOBAL_INT", 0, 1, 1, frame, 3576, x, y, up, *(0.0,) * 8)
        sitl.wait_until(lambda: dist(sitl.position, (0.0, 5.56, 20.0)) < 2.0, within=20.0)
        sitl.send("SET_POSITION_TARGET_GLOBAL_INT", 0, 1, 1, frame, 3576, home.latitude, y, up, *(0.0,) * 8)
        sitl.wait_until(lambda: dist(sitl.position, (0.0, 0.0, 20.0)) < 2.0, within=20.0)
    for yaw in (42.0, 0.0):
        mask, where = 0b100111111000, (home.latitude, home.longitude, 20.0)
        sitl.send("SET_POSITION_TARGET_GLOBAL_INT", 0, 1, 1, 6, mask, *where, *(0.0,) * 6, yaw * 0.0174533, 0.0)
        sitl.wait_until(lambda yaw=yaw: near_angle(heading(sitl), yaw), within=10.0)  # type: ignore[misc]
        held(sitl, lambda yaw=yaw: near_angle(heading(sitl), yaw), 5.0, "heading")  # type: ignore[misc]


def velocities(sitl: Sitl) -> None:
    sitl.takeoff(20.0)
    for north, east, down in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, -1.0, -1.0)):
        velocity(sitl, north, east, down)
        wanted = (east, north, -down)
        sitl.wait_until(lambda wanted=wanted: dist(sitl.velocity, wanted) < 0.3, within=3.0)  # type: ignore[misc]
        velocity(sitl, north, east, down)
        held(sitl, lambda wanted=wanted: dist(sitl.velocity, wanted) < 0.5, 2.0, "velocity")  # type: ignore[misc]
    velocity(sitl, 1.0, -3.6e30, 0.0)
    sitl.wait_until(lambda: hypot(*sitl.velocity) < 0.3, within=5.0)
    held(sitl, lambda: hypot(*sitl.velocity) < 0.3, 10.0, "standing")


def guided_thrust(sitl: Sitl) -> None:
    sitl.takeoff(5.0)
    end = sitl.time_us + 10_000_000
    while sitl.time_us < end:
        sitl.send("SET_ATTITUDE_TARGET", 0, 1, 1, 7, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.5)
        sitl.run(0.2)
    assert height(sitl) > 5.5


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
    held(sitl, lambda: abs(ground_speed(sitl) - 7.0) < 0.5, 3.0, "speed")
    sitl.wait_until(lambda: dist(sitl.position, (0.0, 0.0, 10.0)) < 1.0, within=80.0)
    held(sitl, lambda: dist(sitl.position, (0.0, 0.0, 10.0)) < 2.0 and sitl.armed, 20.0, "hover")


def return_to_rally(sitl: Sitl) -> None:
    sitl.upload_rally([items.Item(mav.MAV_CMD_NAV_RALLY_POINT, place=(-25.0, 50.0, 37.0))])
    sitl.takeoff(10.0)
    sitl.goto(-20.0, 30.0, 20.0)
    sitl.select("RTL")
    sitl.wait_until(lambda: not sitl.armed, within=200.0)
    assert hypot(sitl.position[0] + 25.0, sitl.position[1] - 50.0) < 2.0


def circle_fence(sitl: Sitl) -> None:
    sitl.set_param("FENCE_ENABLE", 1)
    sitl.takeoff(10.0)
    velocity(sitl, 8.0, 0.0, 0.0)
    while shown(sitl) != RTL:
        velocity(sitl, 8.0, 0.0, 0.0)
        sitl.run(1.0)
        assert sitl.time_us < 120e6
    assert latest(sitl, "FENCE_STATUS").breach_status
    home_and_disarmed(sitl)


def height_fence(sitl: Sitl) -> None:
    sitl.set_param("FENCE_ENABLE", 1)
    sitl.takeoff(10.0)
    while shown(sitl) != RTL:
        velocity(sitl, 0.0, 0.0, -2.0)
        sitl.run(1.0)
        assert sitl.time_us < 120e6
    home_and_disarmed(sitl)


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
    for action, mode in ((1, RTL), (3, LAND)):
        sitl.set_param("FS_THR_ENABLE", action)
        sitl.takeoff(10.0)
        sitl.set_param("SIM_RC_FAIL", 1)
        in_mode(sitl, mode)
        sitl.set_param("SIM_RC_FAIL", 0)
        sitl.run(2.0)
        assert shown(sitl) == mode
        home_and_disarmed(sitl)
    sitl.set_param("FS_OPTIONS", 4)
    sitl.takeoff(10.0)
    sitl.set_param("SIM_RC_FAIL", 1)
    sitl.run(3.0)
    assert shown(sitl) == GUIDED


def station_failsafe(sitl: Sitl) -> None:
    for action, mode in ((1, RTL), (5, LAND)):
        sitl.set_param("FS_GCS_ENABLE", action)
        sitl.takeoff(10.0)
        sitl.gcs.silent = True
        in_mode(sitl, mode, 8.0)
        sitl.gcs.silent = False
        says(sitl, "GCS Failsafe Cleared")
        home_and_disarmed(sitl)


def battery_failsafe(sitl: Sitl) -> None:
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
    held(sitl, lambda: ground_speed(sitl) <= 0.1, 10.0, "standing")
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
    held(sitl, lambda: dist(sitl.position[:2], place[:2]) < 10.0 and abs(height(sitl) - 20.0) < 5.0, 30.0, "place")


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


class Row(NamedTuple):
    """Criteria of ArduPilot's tests; `quick` rows are flown in every run."""

    number: int
    tests: str
    flies: Check
    sets: Mapping[str, float] = MappingProxyType({})
    quick: bool = False


ROWS = (
    Row(1, "MAV_CMD_NAV_RETURN_TO_LAUNCH, _LOITER_UNLIM, _VTOL_LAND", commands_change_modes, quick=True),
    Row(2, "GetCapabilities", capabilities, quick=True),
    Row(3, "MissionIndexValidity", index_validity, quick=True),
    Row(4, "InvalidJumpTags", jump_tags, quick=True),
    Row(5, "MAV_CMD_MISSION_START_p1_p2", mission_start_parameters, {"AUTO_OPTIONS": 3}, quick=True),
    Row(6, "NoArmWithoutMissionItems", no_arming_without_items, quick=True),
    Row(7, "ParameterValidation", parameter_validation, quick=True),
    Row(8, "SetHome", set_home),
    Row(10, "SetModesViaAuxSwitch", aux_switches, {"FLTMODE4": CIRCLE, "RC9_OPTION": 18, "RC10_OPTION": 55}),
    Row(11, "InitialMode", initial_mode),
    Row(12, "NoRCOnBootPreArmFailure", no_radio, quick=True),
    Row(13, "FenceUpload_MissionItem", fence_by_old_items, {"FENCE_ENABLE": 1, "FENCE_TYPE": 6}, quick=True),
    Row(14, "MISSION_OPTION_CLEAR_MISSION_AT_BOOT", mission_at_boot),
    Row(16, "MAV_CMD_NAV_TAKEOFF, _command_int", takeoff_heights),
    Row(17, "MAV_CMD_CONDITION_YAW", condition_yaw),
    Row(18, "ModeAltHold", alt_hold),
    Row(19, "ModeLoiter", loiter),
    Row(20, "BrakeMode, BrakeZ", brake),
    Row(21, "PosHoldTakeOff", takeoff_by_stick, {"PILOT_TKOFF_ALT": 700}),
    Row(22, "Landing", landing),
    Row(23, "CopterMission", mission),
    Row(24, "MISSION_START", mission_start),
    Row(25, "NavDelay", nav_delay, {"DISARM_DELAY": 0}),
    Row(26, "TakeoffAlt", takeoff_below),
    Row(27, "PAUSE_CONTINUE", pause_mission, {"AUTO_OPTIONS": 3}),
    Row(28, "PAUSE_CONTINUE_GUIDED", pause_guided, {"GUID_TIMEOUT": 120}),
    Row(29, "DO_CHANGE_SPEED", speeds_in_mission, {"AUTO_OPTIONS": 3}),
    Row(30, "DO_CHANGE_SPEED_in_guided", speeds_in_guided),
    Row(31, "WPNAV_SPEED", speed_parameters),
    Row(31, "WPNAV_SPEED_UP, WPNAV_SPEED_DN", vertical_speed_parameters, {"WPNAV_ACCEL_Z": 400}),
    Row(32, "GuidedSubModeChange", guided_submodes, {"WP_YAW_BEHAVIOR": 0}),
    Row(33, "SetpointGlobalPos", global_positions, {"FS_GCS_ENABLE": 0}),
    Row(34, "SetpointGlobalVel, SetpointBadVel", velocities, {"WPNAV_ACCEL_Z": 250}),
    Row(35, "GuidedModeThrust", guided_thrust, {"GUID_OPTIONS": 8}),
    Row(35, "the climb rate of an attitude's thrust", without_gps),
    Row(36, "WPYawBehaviour1RTL, RTLYaw", return_facing, {"WP_YAW_BEHAVIOR": 1}),
    Row(37, "RTLSpeed, RTL_ALT_FINAL", return_at_height, {"RTL_SPEED": 700, "RTL_ALT_FINAL": 1000}),
    Row(38, "RTL_TO_RALLY", return_to_rally, {"RALLY_INCL_HOME": 0}),
    Row(39, "HorizontalFence", circle_fence, {"FENCE_TYPE": 2, "FENCE_RADIUS": 50}),
    Row(40, "MaxAltFence", height_fence, {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 20}),
    Row(40, "MinAltFence", floor_fence, {"FENCE_TYPE": 8, "FENCE_ALT_MIN": 10}),
    Row(41, "ThrottleFailsafe", radio_failsafe),
    Row(42, "GCSFailsafe", station_failsafe),
    Row(43, "BatteryFailsafe", battery_failsafe, {"BATT_LOW_VOLT": 11.5, "BATT_CRT_VOLT": 10.1, "BATT_LOW_TIMER": 1}),
    Row(44, "AutoContinueOnRCFailsafe, RCOverridesNoRCReceiver", without_receiver, {"FS_OPTIONS": 5}),
    Row(45, "StabilityPatch", weak_motor),
    Row(46, "RudderDisarmMidair, MAV_CMD_DO_FLIGHTTERMINATION", disarming),
    Row(46, "MotorTest", motor_test, quick=True),
)


def _marked(row: Row) -> Any:
    marks = [pytest.mark.sitl(identity="ardupilot", params=dict(row.sets))]
    return pytest.param(
        row.flies, id=f"{row.number}-{row.flies.__name__}", marks=[*marks, *([] if row.quick else [pytest.mark.long])]
    )


@pytest.mark.parametrize("flies", [*map(_marked, ROWS)])
def test_criteria_of_ardupilots_own_tests(sitl: Sitl, flies: Check) -> None:
    flies(sitl)
