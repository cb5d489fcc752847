"""Criteria of ArduPilot's tests that stand on the ground."""

from math import dist, isclose
from typing import Any

import pytest

from colibri.common.earth.geodesy import geodetic_of
from colibri.mavlink.mission.items import FENCE, MISSION
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.autopilot.identities.copter_words import (
    ACCEPTED,
    ALT_HOLD,
    BRAKE,
    CIRCLE,
    DENIED,
    FAILED,
    GLOBAL,
    GUIDED,
    LAND,
    LOITER,
    RELATIVE,
    RTL,
    STABILIZE,
    both,
    in_mode,
    says,
    steered,
    upload,
)
from tests.support.flying import latest


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
    assert sitl.said("item 4 is not within 0 to 3")


def jump_tags(sitl: Sitl) -> None:
    assert sitl.command(mav.MAV_CMD_DO_JUMP_TAG, 65535.0) == FAILED
    assert sitl.command(mav.MAV_CMD_DO_JUMP_TAG, 65536.0) == DENIED
    upload(sitl, items.takeoff(5.0), items.Item(mav.MAV_CMD_JUMP_TAG, (7.0,)))
    assert sitl.command(mav.MAV_CMD_DO_JUMP_TAG, 7.0) == ACCEPTED
    with pytest.raises(sitl.Refused, match=r"item 1: DO_JUMP_TAG \(601\): parameter 1 is 8"):
        upload(sitl, items.Item(mav.MAV_CMD_DO_JUMP_TAG, (8.0, 1.0)))


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


def mode_switch(sitl: Sitl) -> None:
    """Slot 5 has STABILIZE where ArduPilot's test has ACRO, which is refused here."""
    widths = (1165, 1295, 1425, 1555, 1685, 1815)
    modes = dict(zip(widths, (GUIDED, ALT_HOLD, RTL, CIRCLE, STABILIZE, BRAKE), strict=True))
    for width in (*widths, *widths[::-1], *widths):
        steered(sitl, 1.0, c5=width)
        in_mode(sitl, modes[width])


def global_origin(sitl: Sitl) -> None:
    def origin(x: int, y: int, z: float) -> int:
        return sitl.gcs.order_int(mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN, frame=GLOBAL, x=x, y=y, z=z)

    before = latest(sitl, "GPS_GLOBAL_ORIGIN")
    for x, y in ((0, 0), (0, 2140000000), (914564321, 0)):
        assert origin(x, y, 0.0) == DENIED, (x, y)
    assert latest(sitl, "GPS_GLOBAL_ORIGIN").latitude == before.latitude
    x, y, z = -35 * 10**7 - 1234567, 149 * 10**7 + 7654321, 642.5
    assert origin(x, y, z) == ACCEPTED
    shown = latest(sitl, "GPS_GLOBAL_ORIGIN")
    got = shown.latitude, shown.longitude, shown.altitude
    assert got == (x, y, round(z * 1e3)), f"{got}"


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
