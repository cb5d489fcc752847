"""Missions and tracks flown: every kind of item, jumps and delays, pausing, going elsewhere in between, the end."""

from dataclasses import replace
from math import dist, hypot, nan

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, geodetic_of
from colibri.mavlink.mission.items import MISSION, MissionItem
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.start import Start
from tools.harness.client import SYSTEM
from tools.harness.copter_flight import ACCEPTED, DENIED, FLIGHT, CopterFlight, in_the_air

RELATIVE = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
NO_FRAME = mav.MAV_FRAME_MISSION
ACTIVE, PAUSED, COMPLETE = mav.MISSION_STATE_ACTIVE, mav.MISSION_STATE_PAUSED, mav.MISSION_STATE_COMPLETE


def item(command: int, *params: float, east: float = 0.0, north: float = 0.0, up: float = 0.0) -> MissionItem:
    place = geodetic_of((east, north, 0.0), DEFAULT_ORIGIN)
    p1, p2, p3, p4 = (*params, *(0.0,) * (4 - len(params)))
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    return MissionItem(RELATIVE, command, 1, p1, p2, p3, p4, x, y, up)


def do(command: int, *params: float) -> MissionItem:
    return item(command, *params)._replace(frame=NO_FRAME, x=0, y=0)


def waypoint(east: float, north: float, up: float = 3.0, stay_s: float = 0.0) -> MissionItem:
    return item(mav.MAV_CMD_NAV_WAYPOINT, stay_s, 0.3, 0.0, nan, east=east, north=north, up=up)


def load(flight: CopterFlight, *items: MissionItem) -> None:
    flight.copter.stations.plans.load(MISSION, items)


def reached(flight: CopterFlight) -> list[int]:
    return [fields.seq for fields in flight.client.heard["MISSION_ITEM_REACHED"]]


def state(flight: CopterFlight) -> int:
    flight.run(0.02)
    return int(flight.client.latest("MISSION_CURRENT").mission_state)


EVERY_KIND = (
    do(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan)._replace(frame=RELATIVE, z=2.0),
    do(mav.MAV_CMD_DO_CHANGE_SPEED, 1.0, 3.0, -1.0),
    waypoint(3.0, 0.0, 2.0),
    item(mav.MAV_CMD_NAV_LOITER_TIME, 0.5, 0.0, 0.0, nan, east=3.0, north=1.0, up=2.0),
    do(mav.MAV_CMD_DO_JUMP, 3.0, 1.0),
    do(mav.MAV_CMD_CONDITION_YAW, 90.0),
    do(mav.MAV_CMD_NAV_DELAY, 0.5),
    do(mav.MAV_CMD_IMAGE_START_CAPTURE),
    item(mav.MAV_CMD_NAV_LOITER_TURNS, 1.0, 0.0, 1.5, nan, east=3.0, north=2.5, up=2.0),
    item(mav.MAV_CMD_NAV_LOITER_TO_ALT, 0.0, 0.0, 0.0, nan, east=2.0, north=1.0, up=3.0),
    do(mav.MAV_CMD_DO_SET_HOME, 0.0)._replace(frame=RELATIVE, x=473977420, y=85455940, z=0.0),
    do(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH),
)


def test_every_kind_of_item_from_the_ground_to_the_ground() -> None:
    flight = CopterFlight(values={"RTL_RETURN_ALT": 3.0, "COM_DISARM_LAND": 0.1})
    load(flight, *EVERY_KIND)
    assert flight.command(mav.MAV_CMD_MISSION_START) == ACCEPTED
    assert flight.arm() == ACCEPTED
    path = flight.path_until(lambda: not flight.armed, 60.0)
    assert reached(flight) == [0, 1, 2, 3, 4, 3, 4, 5, 6, 7, 8, 9, 10, 11]
    assert flight.client.said("mission says return: return")
    assert hypot(*flight.position[:2]) < 0.15
    assert min(dist(place, (3.0, 1.0, 2.0)) for place in path) < 0.1
    around = [place for place in path if abs(hypot(place[0] - 3.0, place[1] - 2.5) - 1.5) < 0.15]
    assert {(x > 3.0, y > 2.5) for x, y, _ in around} == {(False, False), (False, True), (True, False), (True, True)}
    assert state(flight) == COMPLETE


def test_a_mission_is_left_and_gone_on_with_where_it_was() -> None:
    flight = in_the_air(3.0)
    load(flight, waypoint(4.0, 0.0), waypoint(4.0, 4.0), waypoint(0.0, 4.0, stay_s=0.2))
    pause = mav.MAV_CMD_DO_PAUSE_CONTINUE
    assert flight.command(pause, 1.0) == ACCEPTED
    flight.wait_until(lambda: reached(flight) == [0], within=6.0)
    assert flight.command(pause, 0.0) == ACCEPTED
    assert flight.reported_mode is not None
    assert state(flight) == PAUSED
    flight.run(2.0)
    assert flight.goto(1.0, 1.0, 4.0) == ACCEPTED  # elsewhere, in between
    flight.run(3.0)
    assert flight.command(pause, 1.0) == ACCEPTED
    assert state(flight) == ACTIVE
    assert flight.client.latest("MISSION_CURRENT").seq == 1
    assert flight.goto(5.0, 1.0, 3.0) == ACCEPTED  # out of the flown mission
    assert flight.mode is Mode.HOLD
    assert state(flight) == PAUSED
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.wait_until(lambda: flight.copter.pilot.state.mode is not Mode.MISSION, within=12.0)
    assert flight.client.said("finished: hold")
    assert reached(flight) == [0, 1, 2]
    assert state(flight) == COMPLETE
    flight.run(2.0)
    assert flight.position == pytest.approx((0.0, 4.0, 3.0), abs=0.05)


def test_another_item_is_made_current_in_flight() -> None:
    flight = in_the_air(3.0)
    load(flight, waypoint(30.0, 0.0), waypoint(0.0, 3.0), waypoint(-30.0, 0.0))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.run(0.5)
    flight.send("MISSION_SET_CURRENT", SYSTEM, 1, 1)
    flight.wait_until(lambda: reached(flight) == [1], within=5.0)
    assert flight.position == pytest.approx((0.0, 3.0, 3.0), abs=0.5)
    assert flight.command(mav.MAV_CMD_DO_SET_MISSION_CURRENT, 0.0) == ACCEPTED
    flight.run(2.0)
    assert flight.velocity[0] > 2.0
    for number in (3.0, nan, -2.0, 0.5, 1e9):
        assert flight.command(mav.MAV_CMD_DO_SET_MISSION_CURRENT, number) == DENIED


def test_a_mission_that_ends_on_a_circle_ends_at_rest() -> None:
    flight = in_the_air(3.0)
    load(flight, item(mav.MAV_CMD_NAV_LOITER_TURNS, 0.5, 0.0, 1.5, nan, east=1.5, up=3.0))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.wait_until(lambda: flight.mode is Mode.HOLD, within=10.0)
    flight.run(2.5)
    assert hypot(*flight.velocity) < 0.1


def test_without_a_mission_there_is_none_to_fly() -> None:
    flight = in_the_air()
    assert flight.select(Mode.MISSION) == DENIED
    assert flight.client.said("there is no mission")
    load(flight, waypoint(5.0, 0.0))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.run(1.0)
    load(flight)
    flight.run(3.0)
    assert hypot(*flight.velocity) < 0.1


def test_a_track_is_flown_from_the_ground() -> None:
    flight = CopterFlight()
    flight.set_param("TRACK", 2)
    assert flight.select(Mode.TRACK) == ACCEPTED
    assert flight.arm() == ACCEPTED
    wanted = position(track("line"), np.zeros(1))[0]
    dragged = []
    flight.run(7.0, lambda: dragged.append(flight.position[2] < 0.5 and hypot(*flight.position[:2]) > 0.05))
    assert not any(dragged)
    assert flight.mode is Mode.TRACK
    assert dist(flight.position, wanted) < 1.0
    vx, vy, _ = flight.velocity
    assert (vx, vy) == pytest.approx((0.1, 0.1), abs=0.05)


def test_a_track_from_time_0_on_ends_in_hold() -> None:
    short = replace(track("circle:radius=2,speed=1"), duration_s=2.0)
    start = Start(x=2.0, z=2.0, vy=1.0, psi=90.0, rotors=FLIGHT.simulation.rotor_speed_rpm)
    flight = CopterFlight(start=start, first=short)
    away = []
    flight.run(1.9, lambda: away.append(dist(flight.position, position(short, np.array([flight.time_s]))[0])))
    assert flight.mode is Mode.TRACK
    assert max(away) < 0.1
    flight.run(0.5)
    assert flight.copter.pilot.state.mode is Mode.HOLD
    flight.run(2.0)
    assert hypot(*flight.velocity) < 0.1
