"""Identity `ardupilot`: parameters under two names, missions with home, the radio, texts, streams."""

from typing import Any

import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.tasks.attitude import copter_throttle
from colibri.autopilot.identities import conventions_of
from colibri.autopilot.parameters.definitions import behaviour, definitions
from colibri.mavlink.client.parameters import ListParameters
from colibri.mavlink.mission.items import MISSION
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.autopilot.identities.copter_words import heading, near_angle

ARDUPILOT = conventions_of("ardupilot")
AS_ARDUPILOT = pytest.mark.sitl(identity="ardupilot")
ACCEPTED, DENIED, FAILED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED, mav.MAV_RESULT_FAILED
DO_AUX_FUNCTION, CLEARS_MISSION, HIGH = 218, 58.0, 2.0
GLOBAL, RELATIVE = mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT


def parameters_of() -> Parameters:
    return ARDUPILOT.parameters(definitions(load_profile("flight"), load_vehicle("hummingbird")), 1)


@pytest.mark.parametrize(
    ("changes", "seen"),
    [
        ({"RTL_ALT": 2000}, {"RTL_RETURN_ALT": 20.0}),
        ({"RTL_RETURN_ALT": 12.0}, {"RTL_ALT": 1200}),
        ({"WPNAV_SPEED": 500.0}, {"MPC_XY_CRUISE": 5.0}),
        ({"MPC_LAND_SPEED": 0.7}, {"LAND_SPEED": 70}),
        ({"FENCE_ENABLE": 1}, {"GF_MAX_VER_DIST": 100.0, "GF_MAX_HOR_DIST": 150.0, "GF_ACTION": 3}),
        ({"FENCE_ENABLE": 1, "FENCE_TYPE": 2, "FENCE_ACTION": 2}, {"GF_MAX_VER_DIST": 0.0, "GF_ACTION": 5}),
        ({"GF_MAX_HOR_DIST": 80.0}, {"FENCE_ENABLE": 1, "FENCE_RADIUS": 80.0}),
        ({"FS_GCS_ENABLE": 5}, {"NAV_DLL_ACT": 3}),
        ({"NAV_DLL_ACT": 2}, {"FS_GCS_ENABLE": 1}),
        ({"FS_EKF_ACTION": 0}, {"COM_GNSSLOSS_ACT": 0}),
        ({"FS_THR_ENABLE": 3}, {"NAV_RCL_ACT": 3}),
        ({"SIM_GPS_DISABLE": 1}, {"SIM_GPS1_ENABLE": 0}),
    ],
)
def test_a_change_shows_under_the_other_name(changes: dict[str, Value], seen: dict[str, Value]) -> None:
    parameters = parameters_of()
    for name, value in changes.items():
        assert parameters.set(name, value) is None
    assert {name: parameters[name] for name in seen} == pytest.approx(seen)


def test_defaults_are_arducopters() -> None:
    flies = behaviour(parameters_of())
    assert flies.limits.speed_m_s == pytest.approx(10.0)
    assert (flies.return_height_m, flies.land_speed_m_s, flies.disarm_on_ground_s) == pytest.approx((15.0, 0.5, 10.0))
    assert (flies.return_delay_s, flies.return_cone, flies.uploaded_fence) == (5.0, 3.0, False)
    assert flies.stick_limits is not None
    assert (flies.stick_limits.climb_m_s, flies.stick_limits.lift_m_s2) == (2.5, 2.5)
    assert (flies.copter_items, flies.rally_only, round(flies.hover_throttle, 2)) == (True, False, 0.39)


@pytest.mark.parametrize(("stick", "throttle"), [(0.0, 0.0), (0.25, 0.1813), (0.5, 0.39), (0.7, 0.5953), (1.0, 1.0)])
def test_the_throttle_stick_has_arducopters_curve(stick: float, throttle: float) -> None:
    assert copter_throttle(stick, 0.39) == pytest.approx(throttle, abs=1e-4)


def test_reset_returns_to_arducopters_defaults() -> None:
    parameters = parameters_of()
    parameters.set("WPNAV_SPEED", 300.0)
    parameters.reset()
    while parameters.proposed:
        parameters.settle()
    assert (parameters["WPNAV_SPEED"], parameters["MPC_XY_CRUISE"]) == (1000.0, 10.0)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        ("Arming denied: tilted by 60 degrees, more than 45; moving", "Arm: tilted by 60 degrees, more than 45"),
        ("Arming denied: outside the geofence", "Arm: Vehicle breaching Polygon fence"),
        ("Armed", "Arming motors"),
        ("Disarmed by landing", "Disarming motors"),
        ("mission of 3 items", "Flight plan received"),
        ("Takeoff detected", ""),
        ("Failsafe activated: ground station lost, return", "GCS Failsafe"),
        ("Failsafe cleared: sticks lost", "Radio Failsafe Cleared"),
        ("Warning: battery low", "Battery 1 is low"),
        ("Failsafe cleared: battery critical", ""),
        ("Failsafe cleared: geofence breached", "Fence breach cleared"),
        ("Failsafe cleared: position lost", "EKF Failsafe Cleared"),
        ("Failsafe activated: GPS lost, land", "EKF Failsafe: changed to LAND Mode"),
        ("geofence loaded", ""),
        ("item 0 of the mission: 9.0 m below the ground", "item 1 of the mission: 9.0 m below the ground"),
    ],
)
def test_texts_have_arducopters_words(ours: str, theirs: str) -> None:
    assert ARDUPILOT.rewrite(ours) == theirs


@AS_ARDUPILOT
def test_modes_are_numbered_and_refused_by_name(sitl: Sitl) -> None:
    beat = sitl.gcs.latest("HEARTBEAT")
    assert (beat.autopilot, beat.base_mode, beat.custom_mode, beat.system_status) == (3, 89, 0, 3)
    assert sitl.command(mav.MAV_CMD_DO_SET_MODE, 1.0, 99.0) == FAILED
    assert sitl.command(mav.MAV_CMD_DO_SET_MODE, 0.0, 4.0) == DENIED
    assert sitl.command(mav.MAV_CMD_DO_SET_MODE, 1.0, 14.0) == FAILED
    sitl.run(0.1)
    assert {"No such mode 99", "Mode change to FLIP failed: not flown by Colibri"} <= set(sitl.gcs.texts)
    before = len(sitl.gcs.heard["COMMAND_ACK"])
    sitl.send("SET_MODE", 1, 1, 4)
    sitl.run(0.2)
    ack = sitl.gcs.heard["COMMAND_ACK"][before]
    assert (ack.command, ack.result, sitl.gcs.latest("HEARTBEAT").custom_mode) == (11, ACCEPTED, 4)
    sitl.arm()
    sitl.run(0.2)
    assert sitl.gcs.latest("HEARTBEAT").base_mode == 217


@AS_ARDUPILOT
def test_streams_are_silent_until_requested(sitl: Sitl) -> None:
    sitl.run(1.0)
    assert {name for name in sitl.gcs.heard if sitl.gcs.heard[name]} <= {"HEARTBEAT", "STATUSTEXT"}
    sitl.send("REQUEST_DATA_STREAM", 1, 1, mav.MAV_DATA_STREAM_EXTRA3, 4, 1)
    sitl.run(1.0)
    assert sitl.gcs.latest("EKF_STATUS_REPORT").flags == 831
    assert sitl.get_param("SR0_EXTRA3") == 4
    assert sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, float(mav.MAVLINK_MSG_ID_ODOMETRY)) == FAILED
    assert sitl.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, float(mav.MAVLINK_MSG_ID_ODOMETRY), 1e5) == DENIED


@AS_ARDUPILOT
def test_parameters_are_floats_of_arducopters_types(sitl: Sitl) -> None:
    listing = sitl.gcs._client.begin(ListParameters((1, 1), by_bits=False))  # noqa: SLF001 (no method lists)
    sitl.wait_until(lambda: listing.result is not None, within=10.0)
    kinds = {"RTL_ALT": (1500, 6), "FS_GCS_ENABLE": (0, 2), "LAND_SPEED": (50, 4), "WPNAV_SPEED": (1000.0, 9)}
    assert {name: tuple(listing.held[name]) for name in kinds} == kinds
    before = len(sitl.gcs.heard["PARAM_VALUE"]), len(sitl.gcs.heard["PARAM_ERROR"])
    sitl.send("PARAM_REQUEST_READ", 1, 1, "NOT_THERE", -1)
    sitl.run(0.5)
    assert (len(sitl.gcs.heard["PARAM_VALUE"]), len(sitl.gcs.heard["PARAM_ERROR"])) == before


def asked_for(sitl: Sitl, count: int) -> Any:
    sitl.wait_until(lambda: len(sitl.gcs.heard["MISSION_REQUEST"]) >= count, within=3.0)
    return sitl.gcs.latest("MISSION_REQUEST")


@AS_ARDUPILOT
def test_item_0_is_home_and_a_part_is_replaced(sitl: Sitl) -> None:
    sitl.upload_mission([items.takeoff(5.0), items.waypoint(0.0, 5.0, 5.0), items.jump(1, 2), items.return_home()])
    assert not sitl.gcs.heard["MISSION_REQUEST_INT"]
    asked = len(sitl.gcs.heard["MISSION_REQUEST"])
    sitl.send("MISSION_WRITE_PARTIAL_LIST", 1, 1, 2, 2, MISSION)
    assert asked_for(sitl, asked + 1).seq == 2
    item = (RELATIVE, mav.MAV_CMD_NAV_WAYPOINT, 0, 1, 0.0, 0.0, 0.0, 0.0, 473977420, 85455940, 7.0, MISSION)
    sitl.send("MISSION_ITEM_INT", 1, 1, 2, *item)
    sitl.run(0.2)
    sitl.send("MISSION_REQUEST_LIST", 1, 1, MISSION)
    for seq in range(5):
        sitl.send("MISSION_REQUEST_INT", 1, 1, seq, MISSION)
    sitl.run(0.2)
    assert sitl.gcs.latest("MISSION_COUNT").count == 5
    home, _, way, jump, _ = sitl.gcs.heard["MISSION_ITEM_INT"][-5:]
    assert (home.frame, home.command, way.z, jump.param1) == (GLOBAL, mav.MAV_CMD_NAV_WAYPOINT, 7.0, 2.0)


@AS_ARDUPILOT
def test_missions_are_counted_chosen_and_cleared(sitl: Sitl) -> None:
    sitl.upload_mission([items.takeoff(10.0), items.waypoint(5.0, 0.0, 10.0)])
    assert sitl.get_param("MIS_TOTAL") == 3
    assert sitl.command(mav.MAV_CMD_DO_SET_MISSION_CURRENT, 1.0) == ACCEPTED
    sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_MISSION_CURRENT)
    assert sitl.gcs.latest("MISSION_CURRENT").seq == 1
    assert sitl.command(DO_AUX_FUNCTION, CLEARS_MISSION, HIGH) == ACCEPTED
    sitl.run(0.1)
    assert sitl.get_param("MIS_TOTAL") == 0


@AS_ARDUPILOT
def test_home_and_origin_are_reported_as_they_change(sitl: Sitl) -> None:
    assert not sitl.gcs.heard["HOME_POSITION"]
    sitl.arm()
    sitl.run(0.1)
    assert sitl.gcs.heard["HOME_POSITION"]
    place = {"x": 473977000, "y": 85456000}
    assert sitl.gcs.order_int(mav.MAV_CMD_DO_SET_HOME, frame=GLOBAL, **place, z=490.0) == ACCEPTED
    sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, float(mav.MAVLINK_MSG_ID_HOME_POSITION))
    home = sitl.gcs.latest("HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude) == (*place.values(), 490_000)


@pytest.mark.long
@AS_ARDUPILOT
def test_the_vehicle_looks_along_its_way(sitl: Sitl) -> None:
    sitl.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, float(mav.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT), 1e5)
    sitl.takeoff(2.0)
    sitl.command(mav.MAV_CMD_CONDITION_YAW, 180.0)
    sitl.goto(10.0, 0.0, 2.0, wait=False)
    sitl.run(0.3)
    assert sitl.gcs.latest("NAV_CONTROLLER_OUTPUT").wp_dist == pytest.approx(10.0, abs=1.0)
    sitl.wait_until(lambda: near_angle(heading(sitl), 90.0), within=5.0)
    item = (0, RELATIVE, mav.MAV_CMD_NAV_WAYPOINT, 3, 1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, MISSION)
    sitl.send("MISSION_ITEM", 1, 1, *item)  # changes the height
    sitl.wait_until(lambda: sitl.position[2] > 3.5, within=5.0)
    southward = items.Item(mav.MAV_CMD_NAV_WAYPOINT, (0.0, 0.0, 0.0, 180.0), (10.0, 20.0, 4.0))
    takeoff = items.Item(mav.MAV_CMD_NAV_VTOL_TAKEOFF, place=(10.0, 0.0, 2.0))
    sitl.upload_mission([takeoff, items.Item(mav.MAV_CMD_DO_FENCE_ENABLE, (1.0, 0.0, 0.0, 0.0)), southward])
    sitl.select("AUTO")
    sitl.wait_until(lambda: near_angle(heading(sitl), 0.0, 20.0), within=6.0)
    assert sitl.get_param("FENCE_ENABLE") == 1


@AS_ARDUPILOT
def test_the_radio_is_overridden_by_its_station_alone(sitl: Sitl) -> None:
    def channels() -> tuple[int, ...]:
        sitl.run(0.1)
        sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, float(mav.MAVLINK_MSG_ID_RC_CHANNELS))
        sitl.run(0.1)
        fields = sitl.gcs.latest("RC_CHANNELS")
        return (fields.chancount, fields.chan3_raw, fields.chan4_raw, fields.chan5_raw)

    assert channels() == (8, 1000, 1500, 1800)
    other = sitl.client(200)
    other.send("RC_CHANNELS_OVERRIDE", 1, 1, *(1100,) * 8, *(0,) * 10)
    sitl.run(0.2)
    assert channels() == (8, 1000, 1500, 1800)
    sitl.send("RC_CHANNELS_OVERRIDE", 1, 1, 65535, 65535, 1600, 1700, *(65535,) * 4, *(0,) * 10)
    assert channels() == (8, 1600, 1700, 1800)
    sitl.send("RC_CHANNELS_OVERRIDE", 1, 1, 65535, 65535, 0, *(65535,) * 5, *(0,) * 10)
    assert channels() == (8, 1000, 1700, 1800)
    sitl.run(3.2)
    assert channels() == (8, 1000, 1500, 1800)
