"""A mission of QGroundControl as a track: read strictly, placed by the vehicle's home, and flown."""

import json
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.guidance.trajectories.loading import track_through
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, geodetic_of
from colibri.companion.plan_file import read_plan
from colibri.companion.settings import CompanionSettings
from colibri.companion.stack import CompanionError
from colibri.companion.vehicle_peer import LocalOrigin, VehiclePeer
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.backends.setting import Setting
from colibri.sitl.session import Flights
from tests.colibri.companion.in_memory import AHEAD_US, Port, Ride
from tests.support.refusals import refusal_of

TAKE_OFF, LAND, RETURN, WAYPOINT, CHANGE_SPEED = 22, 21, 20, 16, 178
PLACES = ((0.0, 2.0, 3.0), (4.0, 2.0, 4.0), (4.0, -2.0, 3.0))
ORIGIN = DEFAULT_ORIGIN
HERE = LocalOrigin(ORIGIN, 0.0)


def item(command: int, enu_m: tuple[float, float, float] = (0.0, 0.0, 2.5), **more: Any) -> dict[str, Any]:
    east, north, up = enu_m
    there = geodetic_of((east, north, 0.0), ORIGIN)
    stay, yaw, frame = more.get("stay", 0), more.get("yaw"), more.get("frame", 3)
    numbers = [stay, 0, 0, yaw, there.latitude_deg, there.longitude_deg, more.get("up", up)]
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": numbers, "autoContinue": True}


def waypoints(**more: Any) -> list[dict[str, Any]]:
    return [item(WAYPOINT, place, **more) for place in PLACES]


def plan(folder: Path, items: list[dict[str, Any]], speed_m_s: float = 1.5) -> Path:
    mission = {"version": 2, "items": items, "hoverSpeed": speed_m_s, "plannedHomePosition": list(ORIGIN)}
    path = folder / "mission.plan"
    path.write_text(json.dumps({"fileType": "Plan", "mission": mission}), encoding="utf-8")
    return path


def test_waypoints_are_placed_by_the_home_that_the_vehicle_has(tmp_path: Path) -> None:
    mission = read_plan(plan(tmp_path, [item(TAKE_OFF), *waypoints(), item(RETURN)]))
    assert mission.takeoff_m == 2.5
    assert "item 5 (return) is left to the pilot" in mission.note
    assert mission.waypoints(HERE).points_enu_m == pytest.approx(np.array(PLACES), abs=1e-3)
    south = Geodetic(*geodetic_of((0.0, -10.0, 0.0), ORIGIN))
    moved = mission.waypoints(LocalOrigin(south, -1.5)).points_enu_m
    assert moved == pytest.approx(np.array(PLACES) + np.array([0.0, 10.0, -1.5]), abs=1e-3)


def test_a_track_passes_waypoints_and_rests_at_both_ends(tmp_path: Path) -> None:
    given = read_plan(plan(tmp_path, waypoints())).waypoints(HERE)
    flown = track_through(given, load_vehicle("hummingbird"), load_profile("flight")).track
    passed = position(flown, given.times_s)
    assert passed == pytest.approx(np.array(PLACES), abs=0.02)
    assert position(flown, given.times_s[[0, -1]], 1) == pytest.approx(0.0, abs=1e-6)


def test_headings_are_clockwise_from_north(tmp_path: Path) -> None:
    looks = read_plan(plan(tmp_path, waypoints(yaw=90))).waypoints(HERE).yaw_rad
    assert looks == pytest.approx(0.0)
    assert read_plan(plan(tmp_path, waypoints(yaw=0))).waypoints(HERE).yaw_rad == pytest.approx(0.5 * pi)
    assert read_plan(plan(tmp_path, waypoints())).waypoints(HERE).yaw_rad is None


REFUSED: dict[str, tuple[list[dict[str, Any]], str]] = {
    "no waypoint": ([*waypoints(), item(CHANGE_SPEED), item(RETURN)], "item 4 is no waypoint (DO_CHANGE_SPEED)"),
    "take-off later": ([*waypoints(), item(TAKE_OFF)], "item 4 is no waypoint (NAV_TAKEOFF)"),
    "landing before the end": ([item(LAND), *waypoints()], "item 1 is no waypoint (NAV_LAND)"),
    "survey": ([*waypoints(), {"type": "ComplexItem", "complexItemType": "survey"}], "item 4 is no waypoint (survey)"),
    "stays": (waypoints(stay=5), "item 1 stays for 5 s"),
    "above the sea": (waypoints(frame=0), "item 1 is not at a height above home"),
    "below home": (waypoints(up=-1), "item 1 is -1 m above home"),
    "no number": (waypoints(up="high"), "item 1 has 'high' where a number belongs"),
    "not finite": (waypoints(up=nan), "item 1 has 'nan' where a number belongs"),
    "some headings": ([*waypoints(), item(WAYPOINT, (0.0, 0.0, 3.0), yaw=0)], "some waypoints have a heading"),
    "one waypoint": (waypoints()[:1], "needs two waypoints"),
    "no params": ([{"type": "SimpleItem", "command": WAYPOINT}], "item 1 has no command with seven parameters"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_track_can_fly_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    items, said = REFUSED[name]
    path = plan(tmp_path, items)
    message = refusal_of(read_plan, path)
    assert said in message
    assert message.startswith(f"{path}: ")


def test_a_waypoint_twice_is_refused_by_its_number(tmp_path: Path) -> None:
    mission = read_plan(plan(tmp_path, [item(TAKE_OFF), *waypoints()[:1] * 2]))
    with pytest.raises(CompanionError, match="item 3 is where the waypoint before it is"):
        mission.waypoints(HERE)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"mission": 1}', '{"mission": {"items": []}}', "\x00"])
def test_a_file_that_is_no_mission_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "mission.plan"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CompanionError, match="no mission of QGroundControl"):
        read_plan(path)
    with pytest.raises(CompanionError, match="No such file"):
        read_plan(tmp_path / "none.plan")
    with pytest.raises(CompanionError, match="no mission of QGroundControl"):
        read_plan(plan(tmp_path, waypoints(), speed_m_s=inf))


@pytest.mark.long
def test_a_mission_is_flown_from_the_vehicles_home(tmp_path: Path) -> None:
    with Flights(Setting(), None) as flights:
        sitl = flights.begin(airborne=2.5)
        port, peer = Port(sitl), VehiclePeer()
        while (home := peer.seek_home(sitl.time_us + AHEAD_US)) is None:
            assert sitl.time_s < 10.0
            port.carry(peer.poll(sitl.time_us + AHEAD_US))
            sitl.step()
            for datagram in port.take():
                peer.receive(datagram, sitl.time_us + AHEAD_US)
        mission = read_plan(plan(tmp_path, [item(TAKE_OFF), *waypoints()], speed_m_s=4.0))
        given = mission.waypoints(home)
        assert given.points_enu_m == pytest.approx(np.array(PLACES), abs=0.03)
        flown = track_through(given, load_vehicle("hummingbird"), load_profile("flight"), home.up_m).track
        ride = Ride(sitl, flown, CompanionSettings())
        ended = ride.to_the_end(40.0)
        assert ended.in_order, ended.why
        assert ride.companion.errors.rmse_m() < 0.05
        assert sitl.position == pytest.approx(PLACES[-1], abs=0.3)
