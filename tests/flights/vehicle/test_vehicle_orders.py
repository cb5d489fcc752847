"""Commands to a vehicle in the air: reposition, orbit, speed; and which it refuses."""

from math import atan2, dist, hypot, inf, isfinite, nan, pi, remainder, tau
from typing import Any

import pytest

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, geodetic_of
from colibri.common.types import Vector
from colibri.mavlink.mission.items import FENCE, MissionItem
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import mav
from tools.harness.client import SYSTEM
from tools.harness.copter_flight import ACCEPTED, DENIED, STANDING, CopterFlight, in_the_air

GLOBAL, RELATIVE = mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
REPOSITION = mav.MAV_CMD_DO_REPOSITION
ORBIT = mav.MAV_CMD_DO_ORBIT
UNSUPPORTED = mav.MAV_RESULT_UNSUPPORTED


def degrees_e7(east_m: float, north_m: float) -> tuple[int, int]:
    place = geodetic_of((east_m, north_m, 0.0), DEFAULT_ORIGIN)
    return round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)


def turned_by(flight: CopterFlight, yaw_rad: float) -> float:
    return abs(remainder(flight.yaw_rad - yaw_rad, tau))


def test_it_goes_to_a_place_without_overshoot_and_holds_it() -> None:
    flight = in_the_air()
    assert flight.goto(6.0, -2.5, 6.0) == ACCEPTED
    path = flight.path(5.0)
    assert max(x for x, _, _ in path) < 6.03
    assert min(y for _, y, _ in path) > -2.53
    assert flight.position == pytest.approx((6.0, -2.5, 6.0), abs=0.05)
    assert turned_by(flight, atan2(-2.5, 6.0)) < 0.05  # it looked where it went
    flight.run(0.5)
    assert max(dist(place, (6.0, -2.5, 6.0)) for place in flight.path(1.0)) < 0.02


def test_hold_stops_it_and_it_stays_there() -> None:
    flight = in_the_air()
    assert flight.goto(50.0, 0.0, 5.0) == ACCEPTED
    flight.wait_until(lambda: flight.velocity[0] > 4.5, within=6.0)
    began = flight.position[0]
    assert flight.select(Mode.HOLD) == ACCEPTED
    flight.run(3.5)
    assert flight.position[0] - began < 6.5  # 5 m/s at 3 m/s², and the jerk's time
    held = flight.position
    assert max(dist(place, held) for place in flight.path(1.0)) < 0.05


@pytest.mark.parametrize(
    ("params", "place", "expected"),
    [
        ((-1.0, 1.0, 0.0, nan), (2.0, 1.0, 6.0), (2.0, 1.0, 6.0)),
        ((nan, nan, nan, pi), (2.0, 1.0, nan), (2.0, 1.0, 5.0)),
        ((-1.0, 1.0, 0.0, nan), (nan, nan, 6.0), (0.0, 0.0, 6.0)),
        ((-1.0, 0.0, 0.0, 0.5 * pi), (nan, nan, nan), (0.0, 0.0, 5.0)),
    ],
    ids=["place", "no height", "height alone", "yaw alone"],
)
def test_what_a_reposition_leaves_out_stays(params: tuple[float, ...], place: Vector, expected: Vector) -> None:
    flight = in_the_air()
    x, y, z = place
    where = dict(zip("xy", degrees_e7(x, y), strict=True)) if isfinite(x) else {}
    assert flight.command_int(REPOSITION, *params, frame=RELATIVE, **where, z=z) == ACCEPTED
    flight.run(3.5)
    assert flight.position == pytest.approx(expected, abs=0.05)
    if isfinite(params[3]):
        assert turned_by(flight, 0.5 * pi - params[3]) < 0.1
    elif not isfinite(x):
        assert turned_by(flight, 0.5 * pi) < 0.02


def test_a_reposition_to_nowhere_pauses() -> None:
    """As QGroundControl's pause button does, in a mission too."""
    flight = in_the_air()
    assert flight.goto(50.0, 0.0, 5.0) == ACCEPTED
    flight.run(2.0)
    assert flight.command(REPOSITION, -1.0, 1.0, 0.0, nan, nan, nan, nan) == ACCEPTED
    flight.run(3.0)
    assert hypot(*flight.velocity) < 0.1
    assert flight.mode is Mode.HOLD


def test_a_reposition_that_cannot_be_flown_is_denied() -> None:
    flight = in_the_air()
    x, y = degrees_e7(3.0, 3.0)
    good, place = (-1.0, 1.0, 0.0, nan), (x, y, 5.0)
    bad_params = ((inf, *good[1:]), (40.0, *good[1:]), (-3.0, *good[1:]), (-1.0, 3.0, 0.0, nan), (*good[:3], inf))
    bad_places = ((x, y, inf), (x, y, 2e4), (900000001, y, 5.0), (x, 1800000001, 5.0), (0, 0, 5.0), (x, NOT_GIVEN, 5.0))
    for params, (east, north, up) in [(bad, place) for bad in bad_params] + [(good, bad) for bad in bad_places]:
        assert flight.command_int(REPOSITION, *params, frame=RELATIVE, x=east, y=north, z=up) == DENIED
    assert flight.command_int(REPOSITION, *good[:3], 100.0, frame=RELATIVE, x=x, y=y, z=5.0) == DENIED
    assert flight.client.said("reposition refused: ")
    flight.run(0.5)
    assert hypot(*flight.velocity) < 0.05


def test_on_the_ground_nothing_is_flown_to() -> None:
    flight = CopterFlight()
    assert flight.goto(1.0, 1.0, 5.0) == DENIED
    assert flight.command_int(ORBIT, 5.0, 2.0, 0.0, nan, frame=RELATIVE) == DENIED
    assert flight.command(mav.MAV_CMD_CONDITION_YAW, 90.0) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    assert flight.select(Mode.ORBIT) == DENIED
    assert flight.mode is Mode.HOLD


ORBITS = [
    (mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER, 3.0, pi),
    (mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE, -3.0, 0.5 * pi),
    (mav.ORBIT_YAW_BEHAVIOUR_HOLD_INITIAL_HEADING, -3.0, None),
]


@pytest.mark.parametrize(("behaviour", "radius", "look"), ORBITS)
def test_an_orbit_turns_both_ways_and_looks_as_told(behaviour: int, radius: float, look: float | None) -> None:
    flight = in_the_air()
    assert flight.command_int(ORBIT, radius, 2.0, float(behaviour), nan, frame=RELATIVE) == ACCEPTED
    flight.run(5.0)
    x, y, z = flight.position
    assert (hypot(x, y), z) == pytest.approx((3.0, 5.0), abs=0.1)
    vx, vy, _ = flight.velocity
    assert x * vy - y * vx == pytest.approx(-radius * 2.0, abs=0.5)  # positive flies clockwise
    assert turned_by(flight, 0.5 * pi if look is None else atan2(y, x) + look) < 0.1


def test_an_orbit_commanded_again_goes_on_from_where_it_is() -> None:
    flight = in_the_air()
    x, y = degrees_e7(0.0, 0.0)
    center: dict[str, Any] = {"frame": RELATIVE, "x": x, "y": y, "z": DEFAULT_ORIGIN.altitude_m + 5.0}
    assert flight.command_int(ORBIT, 4.0, 2.0, nan, nan, **center) == ACCEPTED
    flight.run(5.0)
    assert flight.command_int(ORBIT, 4.0, 3.0, nan, nan, **center) == ACCEPTED
    slowest = min(_speed_while(flight, 2.0))
    assert slowest > 1.9
    assert hypot(*flight.velocity) == pytest.approx(3.0, abs=0.1)
    assert flight.command_int(ORBIT, -4.0, 3.0, nan, nan, **center) == ACCEPTED
    away = [hypot(x, y) for x, y, _ in flight.path(4.0)]
    assert min(away) > 3.8
    assert max(away) < 4.2
    assert flight.command_int(ORBIT, -2.0, 2.0, nan, nan, **center) == ACCEPTED
    flight.run(4.0)
    assert hypot(*flight.position[:2]) == pytest.approx(2.0, abs=0.15)
    assert flight.select(Mode.HOLD) == ACCEPTED
    flight.run(3.0)
    assert hypot(*flight.velocity) < 0.1


def _speed_while(flight: CopterFlight, seconds: float) -> list[float]:
    speeds = []
    flight.run(seconds, lambda: speeds.append(hypot(*flight.velocity)))
    return speeds


def test_an_orbit_that_cannot_be_flown_is_denied() -> None:
    flight = in_the_air()
    radii = ((0.5, 2.0, 0.0), (inf, 2.0, 0.0), (1e30, 2.0, 0.0))
    speeds = ((5.0, 0.0, 0.0), (5.0, 99.0, 0.0), (5.0, inf, 0.0))
    looks = ((5.0, 2.0, 0.5), (5.0, 2.0, 9.0), (5.0, 2.0, -1.0))
    for params in (*radii, *speeds, *looks):
        assert flight.command_int(ORBIT, *params, nan, frame=RELATIVE) == DENIED
    half_a_place = degrees_e7(5.0, 5.0)[0]
    assert flight.command_int(ORBIT, 5.0, 2.0, 0.0, nan, frame=RELATIVE, x=half_a_place) == DENIED
    assert flight.mode is Mode.HOLD


def test_speed_can_be_changed_in_flight_and_is_forgotten_after_it() -> None:
    flight = in_the_air()
    assert flight.goto(60.0, 0.0, 5.0) == ACCEPTED
    speed = mav.MAV_CMD_DO_CHANGE_SPEED
    assert flight.command(speed, 1.0, 2.0, -1.0) == ACCEPTED
    flight.run(3.0)
    assert hypot(*flight.velocity) == pytest.approx(2.0, abs=0.05)
    assert flight.command(speed, 1.0, -1.0) == ACCEPTED
    for number in (0.0, -3.0, nan, inf, 100.0):
        assert flight.command(speed, 1.0, number) == DENIED
    assert flight.command(speed, 2.0, 3.0) == UNSUPPORTED  # of climbs
    flight.run(0.5)
    assert hypot(*flight.velocity) == pytest.approx(2.0, abs=0.05)
    assert flight.command(speed, 1.0, -2.0) == ACCEPTED
    flight.run(2.5)
    assert hypot(*flight.velocity) == pytest.approx(5.0, abs=0.05)
    assert flight.command(speed, 1.0, 3.0) == ACCEPTED
    assert flight.disarm(force=True) == ACCEPTED
    assert flight.copter.pilot.speed_m_s is None


def test_turns() -> None:
    flight = in_the_air()
    yaw = mav.MAV_CMD_CONDITION_YAW
    assert flight.command(yaw, 90.0, 0.0, 0.0, 0.0) == ACCEPTED  # east
    flight.run(3.5)
    assert turned_by(flight, 0.0) < 0.02
    assert flight.command(yaw, 30.0, 0.0, -1.0, 1.0) == ACCEPTED  # further to the left
    flight.run(2.5)
    assert turned_by(flight, pi / 6.0) < 0.02
    for params in ((nan,), (inf,), (400.0,), (90.0, 0.0, 2.0, 0.0), (90.0, 0.0, 0.0, 5.0)):
        assert flight.command(yaw, *params) == DENIED
    assert flight.position == pytest.approx((0.0, 0.0, 5.0), abs=0.02)


def test_home_and_origin() -> None:
    flight = in_the_air()
    flight.goto(3.0, 4.0, 5.0)
    flight.run(4.0)
    home = mav.MAV_CMD_DO_SET_HOME
    x, y = degrees_e7(1.0, -2.0)
    above_sea = DEFAULT_ORIGIN.altitude_m + 0.5
    assert flight.command_int(home, 0.0, 0.0, 0.0, 0.0, frame=RELATIVE, x=x, y=y, z=above_sea) == ACCEPTED
    assert flight.copter.pilot.home.position_enu_m == pytest.approx((1.0, -2.0, 0.5), abs=0.02)
    flight.run(1.1)
    reported = flight.client.latest("HOME_POSITION")
    assert (reported.latitude, reported.longitude) == pytest.approx((x, y), abs=2)
    for bad_x, bad_y, z in ((950000000, y, 500.0), (x, y, nan), (0, 0, 500.0), (NOT_GIVEN, NOT_GIVEN, 500.0)):
        assert flight.command_int(home, 0.0, 0.0, 0.0, 0.0, frame=RELATIVE, x=bad_x, y=bad_y, z=z) == DENIED
    assert flight.command(home, 2.0) == DENIED
    assert flight.copter.pilot.home.position_enu_m == pytest.approx((1.0, -2.0, 0.5), abs=0.02)
    assert flight.command(home, 1.0) == ACCEPTED
    assert flight.copter.pilot.home.position_enu_m == pytest.approx((3.0, 4.0, 5.0), abs=0.1)
    flight.send("SET_GPS_GLOBAL_ORIGIN", SYSTEM, 473000000, 85000000, 500000)
    flight.run(0.05)
    assert flight.client.said("origin refused: the rotors are armed")
    assert flight.copter.pilot.home.origin == DEFAULT_ORIGIN


def test_the_origin_is_set_on_the_ground_and_told_to_the_digit() -> None:
    flight = CopterFlight()
    flight.send("SET_GPS_GLOBAL_ORIGIN", SYSTEM, 473000001, -85000003, 500004)
    flight.run(0.05)
    reported = flight.client.latest("GPS_GLOBAL_ORIGIN")
    assert (reported.latitude, reported.longitude, reported.altitude) == (473000001, -85000003, 500004)
    assert flight.copter.pilot.home.origin == pytest.approx(Geodetic(47.3000001, -8.5000003, 500.004))
    origin = mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN
    assert flight.command_int(origin, frame=GLOBAL) == DENIED
    assert flight.command_int(origin, frame=GLOBAL, x=473977420, y=85455940, z=inf) == DENIED
    assert flight.command_int(origin, frame=GLOBAL, x=473977420, y=85455940, z=488.0) == ACCEPTED
    flight.send("SET_HOME_POSITION", SYSTEM, *degrees_e7(5.0, 5.0), 490000, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0)
    flight.run(0.05)
    assert flight.copter.pilot.home.position_enu_m == pytest.approx((5.0, 5.0, 2.0), abs=0.02)


def test_modes_by_message_and_by_standard_number() -> None:
    flight = in_the_air()
    flight.send("SET_MODE", SYSTEM, mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, custom_mode(Mode.LAND))
    flight.run(0.05)
    assert flight.mode is Mode.LAND
    flight.send("SET_MODE", SYSTEM, mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 99 << 16)
    flight.run(0.05)
    assert flight.client.said("this vehicle has no such mode")
    assert flight.reported_mode is not Mode.HOLD
    standard = mav.MAV_CMD_DO_SET_STANDARD_MODE
    assert flight.command(standard, float(mav.MAV_STANDARD_MODE_SAFE_RECOVERY)) == ACCEPTED
    for number in (0.0, 99.0, 1.5, nan, -1.0):
        assert flight.command(standard, number) in (DENIED, UNSUPPORTED, mav.MAV_RESULT_FAILED)
    for numbers in ((0.0, 4.0, 3.0), (1.0, 99.0), (1.0, nan), (nan, 4.0, 3.0), (1.0, 4.5, 3.0), (1.0, 4.0, -1.0)):
        assert flight.command(mav.MAV_CMD_DO_SET_MODE, *numbers) in (DENIED, UNSUPPORTED)
    assert flight.copter.pilot.state.mode is Mode.RETURN


def fence(*places: tuple[float, float]) -> tuple[MissionItem, ...]:
    vertex = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    return tuple(
        MissionItem(GLOBAL, vertex, 0, float(len(places)), 0.0, 0.0, 0.0, *degrees_e7(*place), 0.0) for place in places
    )


def test_nothing_is_flown_to_outside_the_geofence() -> None:
    flight = in_the_air()
    flight.copter.stations.plans.load(FENCE, fence((-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (-8.0, 8.0)))
    assert flight.goto(9.0, 0.0, 5.0) == DENIED
    assert flight.client.said("reposition refused: outside the geofence")
    assert flight.command_int(ORBIT, 9.0, 2.0, nan, nan, frame=RELATIVE) == DENIED  # its centre alone is inside
    assert flight.client.said("orbit refused: outside the geofence")
    assert flight.command_int(ORBIT, 7.0, 2.0, nan, nan, frame=RELATIVE) == ACCEPTED
    x, y = degrees_e7(20.0, 0.0)
    home = mav.MAV_CMD_DO_SET_HOME
    assert flight.command_int(home, 0.0, 0.0, 0.0, 0.0, frame=RELATIVE, x=x, y=y, z=488.0) == DENIED
    flight.disarm(force=True)
    flight.reset_world(STANDING)
    flight.copter.stations.plans.load(FENCE, fence((20.0, 20.0), (30.0, 20.0), (30.0, 30.0)))
    assert flight.command(mav.MAV_CMD_NAV_TAKEOFF, *(nan,) * 7) == DENIED
    flight.wait_until(lambda: flight.copter.pilot.ground.standing, within=4.0)
    flight.run(0.2)
    assert flight.arm() == DENIED
    assert flight.client.said("not armed: outside the geofence")


def test_home_beyond_the_geofence_is_returned_to_all_the_same() -> None:
    flight = in_the_air(2.0, values={"RTL_RETURN_ALT": 2.0, "RTL_MIN_DIST": 1.0, "COM_DISARM_LAND": 0.1})
    flight.goto(5.0, 0.0, 2.0)
    flight.run(2.5)
    flight.copter.stations.plans.load(FENCE, fence((4.0, -8.0), (9.0, -8.0), (9.0, 8.0), (4.0, 8.0)))
    assert flight.select(Mode.RETURN) == ACCEPTED
    flight.wait_until(lambda: not flight.armed, within=25.0)
    assert hypot(*flight.position[:2]) < 0.1


def test_an_orbit_counts_from_its_own_centre() -> None:
    flight = in_the_air()
    x, y = degrees_e7(5.0, 0.0)
    assert flight.command_int(ORBIT, 2.0, 2.0, nan, nan, frame=RELATIVE, x=x, y=y, z=nan) == ACCEPTED
    flight.run(4.5)
    for place in flight.path(1.0)[::25]:
        assert hypot(place[0] - 5.0, place[1]) == pytest.approx(2.0, abs=0.1)
