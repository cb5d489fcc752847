"""The page's end of a link: at our own vehicle in simulated time, and at what PX4 and ArduPilot send."""

from math import pi, radians
from typing import Any

import numpy as np
import pytest

from colibri.common.earth.geodesy import Geodetic, geodetic_of
from colibri.mavlink.client.modes import ARDUPILOT, MODES
from colibri.mavlink.mission.items import FENCE
from colibri.mavlink.wire.dialect import Codec, mav
from colibri.sitl.mission_items import land, takeoff, waypoint
from colibri.sitl.vehicle import Sitl
from colibri.view.observer import CHOICES, COMPONENT, SYSTEM, VehicleObserver
from colibri.view.snapshot import Snapshot, VehicleShape
from tools.pages.pictures.watched import watched

HOME = Geodetic(47.0, 8.0, 400.0)


def test_orders_fly_the_vehicle_and_the_page_sees_it(sitl: Sitl) -> None:
    observer = watched(sitl)

    def now() -> Snapshot:
        return observer.telemetry.snapshot(sitl.time_us / 1e6)

    seen_there = lambda: observer.telemetry.system and observer.telemetry.origin  # noqa: E731
    sitl.wait_until(seen_there, within=10.0, what="a heartbeat and an origin")
    observer.arm(True)
    sitl.wait_until(lambda: sitl.armed, within=3.0, what="arming")
    observer.take_off(4.0)
    sitl.wait_until(lambda: sitl.is_at((0.0, 0.0, 4.0)), within=20.0, what="the climb")
    observer.go_to((3.0, 2.0, 5.0))
    sitl.wait_until(lambda: sitl.is_at((3.0, 2.0, 5.0)), within=20.0, what="the way")
    seen = now()
    assert seen.position_enu_m == pytest.approx(sitl.position, abs=0.1)
    assert seen.armed
    assert seen.mode == "Hold"
    assert all(0.2 < part < 1.0 for part in seen.rotors)
    assert seen.reference_enu_m == pytest.approx((3.0, 2.0, 5.0), abs=0.3)
    assert len(seen.horizon) == 6
    assert len(seen.trail) > 10
    assert any("accepted" in text for text in seen.texts)
    charts = {chart.title: chart for chart in observer.telemetry.charts()}
    assert {"position error, m", "active constraints", "QP time, ms"} <= charts.keys()
    rotors = charts["rotors, % of the largest"]
    assert rotors.names[4:] == ("(stopped)", "(largest)")
    assert {(low, high) for low, high in rotors.values[4:].T} == {(0.0, 100.0)}
    assert rotors.headline.max() < 100.0
    observer.set_mode("Land")
    sitl.wait_until(lambda: now().mode == "Land", within=5.0, what="the mode")


def test_plans_are_drawn_where_they_lie(sitl: Sitl) -> None:
    sitl.upload_mission([takeoff(3.0), waypoint(5.0, 0.0, 3.0), land(0.0, 0.0)])
    observer = watched(sitl)
    sitl.wait_until(lambda: len(observer.surroundings.mission) > 1, within=15.0, what="the mission")
    marks = {mark.text: mark.place_enu_m for mark in observer.surroundings.mission}
    assert marks["2"] == pytest.approx((5.0, 0.0, 3.0), abs=0.05)


@pytest.fixture
def others() -> tuple[VehicleObserver, Any]:
    observer, codec = VehicleObserver(), Codec(1, 1)

    def send(name: str, *fields: Any) -> None:
        observer.receive(codec.encode(name, *fields), 1.0)

    send("HEARTBEAT", mav.MAV_TYPE_QUADROTOR, ARDUPILOT, 0x81, 4, mav.MAV_STATE_ACTIVE, 3)
    return observer, send


def test_a_foreign_vehicle_is_seen_by_its_common_messages(others: tuple[VehicleObserver, Any]) -> None:
    observer, send = others
    east_of_home = geodetic_of((10.0, 0.0, 7.0), HOME)
    send("GPS_GLOBAL_ORIGIN", round(HOME[0] * 1e7), round(HOME[1] * 1e7), round(HOME[2] * 1e3))
    place = (round(east_of_home[0] * 1e7), round(east_of_home[1] * 1e7), round(east_of_home[2] * 1e3))
    send("GLOBAL_POSITION_INT", 1000, *place, 7000, 300, 0, 0, 9000)
    send("ATTITUDE", 1000, radians(10.0), 0.0, pi / 2.0, 0.0, 0.0, 0.0)
    send("SERVO_OUTPUT_RAW", 1000, 0, 1500, 1600, 1000, 2000, 0, 0, 0, 0)
    send("STATUSTEXT", 6, "hello")
    now = observer.telemetry.snapshot(1.1)
    assert (now.mode, now.armed) == ("Guided", True)
    assert now.position_enu_m == pytest.approx((10.0, 0.0, 7.0), abs=0.05)
    assert now.velocity_enu_m_s == pytest.approx((0.0, 3.0, 0.0))
    assert now.rotors == pytest.approx((0.5, 0.6, 0.0, 1.0))
    assert now.attitude == pytest.approx((np.cos(radians(5.0)), np.sin(radians(5.0)), 0.0, 0.0), abs=1e-6)
    assert now.texts == ("hello",)
    assert not len(now.horizon)
    assert observer.telemetry.snapshot(60.0).mode == "no heartbeat"


def test_as_many_rotors_are_drawn_as_the_vehicle_has() -> None:
    observer, codec = VehicleObserver(), Codec(1, 1)

    def feed(time_s: float, name: str, *fields: Any) -> None:
        observer.receive(codec.encode(name, *fields), time_s)

    for time_s in (0.0, 0.1, 0.2, 0.3):
        feed(time_s, "HEARTBEAT", mav.MAV_TYPE_HEXAROTOR, ARDUPILOT, 0x81, 4, mav.MAV_STATE_ACTIVE, 3)
        feed(time_s, "SERVO_OUTPUT_RAW", 1000, 0, 1500, 1600, 1000, 2000, 1100, 1200, 0, 0)
        feed(time_s, "LOCAL_POSITION_NED", 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert observer.telemetry.snapshot(0.3).rotors == pytest.approx((0.5, 0.6, 0.0, 1.0, 0.1, 0.2))
    chart = next(chart for chart in observer.telemetry.charts() if chart.title.startswith("rotors"))
    assert chart.names[:6] == ("1", "2", "3", "4", "5", "6")
    assert len(VehicleShape.of(6).rotors_m) == 6


def test_a_fence_comes_item_by_item(others: tuple[VehicleObserver, Any]) -> None:
    observer, send = others
    send("GPS_GLOBAL_ORIGIN", round(HOME[0] * 1e7), round(HOME[1] * 1e7), round(HOME[2] * 1e3))
    corners = [geodetic_of((east, north, 0.0), HOME) for east, north in ((9.0, 9.0), (-9.0, 9.0), (0.0, -9.0))]
    vertex, ring = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
    items = [(vertex, 3.0, there) for there in corners] + [(ring, 2.5, HOME)]
    observer.poll(2.0)
    send("MISSION_COUNT", SYSTEM, COMPONENT, len(items), FENCE)
    for seq, (command, p1, there) in enumerate(items):
        assert names(observer, 2.0) == ["MISSION_REQUEST_INT"]
        assert not list(observer.surroundings.fence)
        place = (round(there[0] * 1e7), round(there[1] * 1e7), 0.0)
        send("MISSION_ITEM_INT", SYSTEM, COMPONENT, seq, 5, command, 0, 1, p1, 0.0, 0.0, 0.0, *place, FENCE)
    assert names(observer, 2.0) == ["MISSION_ACK"]
    inside, outside = observer.surroundings.fence
    assert inside.keeps_in
    assert not outside.keeps_in
    assert inside.corners_m == pytest.approx(np.array([[9.0, 9.0], [-9.0, 9.0], [0.0, -9.0]]), abs=0.05)
    assert np.linalg.norm(outside.corners_m, axis=1) == pytest.approx(2.5, abs=0.05)


def test_an_order_is_said_again_until_it_is_answered(others: tuple[VehicleObserver, Any]) -> None:
    observer, send = others
    observer.land()
    sent = [landings(observer, at_s) for at_s in (10.0, 10.5, 11.1)]
    assert sent == [1, 0, 1]
    send("COMMAND_ACK", mav.MAV_CMD_NAV_LAND, mav.MAV_RESULT_DENIED, 0, 0, SYSTEM, COMPONENT)
    assert observer.telemetry.snapshot(11.1).texts[0] == "land: denied"
    assert not landings(observer, 13.0)


def test_nobody_answers() -> None:
    observer = VehicleObserver()
    observer.land()
    assert observer.telemetry.snapshot(0.0).texts == ("land: no vehicle connected",)


def test_it_does_not_pass_for_a_ground_station() -> None:
    observer = VehicleObserver()
    (beat,) = Codec(1, 1).decode(observer.poll(0.0)[0])
    assert beat.fields.type != mav.MAV_TYPE_GCS


def test_offered_modes_exist() -> None:
    for autopilot, offered in CHOICES.items():
        assert set(offered) <= MODES[autopilot].keys()


def messages(observer: VehicleObserver, at_s: float) -> list[Any]:
    return [message for each in observer.poll(at_s) for message in Codec(1, 1).decode(each)]


def names(observer: VehicleObserver, at_s: float) -> list[str]:
    """Return the names of what is sent at a time, but for streams and commands."""
    return [message.name for message in messages(observer, at_s) if message.name not in ("HEARTBEAT", "COMMAND_LONG")]


def landings(observer: VehicleObserver, at_s: float) -> int:
    numbers = [each.fields.command for each in messages(observer, at_s) if each.name == "COMMAND_LONG"]
    return numbers.count(mav.MAV_CMD_NAV_LAND)
