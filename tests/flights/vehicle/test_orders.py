"""Commands to a vehicle in the air: places, orbits, speeds, headings, home, modes; and what a geofence refuses."""

from math import atan2, dist, hypot, inf, nan, pi, remainder, tau

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import Bits, mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED, DENIED, QUICK, RELATIVE, SYSTEM, degrees_e7, orbit, refused

pytestmark = [QUICK, pytest.mark.sitl(airborne=5.0)]


def turned_by(sitl: Sitl, yaw_rad: float) -> float:
    return abs(remainder(sitl.euler[2] - yaw_rad, tau))


def test_it_goes_to_a_place_without_overshoot(sitl: Sitl) -> None:
    sitl.goto(6.0, -2.5, 6.0, wait=False)
    sitl.run(5.0)
    assert sitl.path[:, 0].max() < 6.03
    assert sitl.path[:, 1].min() > -2.53
    assert turned_by(sitl, atan2(-2.5, 6.0)) < 0.05  # it looked where it went
    sitl.run(0.5)
    sitl.hold(lambda: dist(sitl.position, (6.0, -2.5, 6.0)) < 0.02, for_=1.0)


def test_a_reposition_without_a_height_keeps_it(sitl: Sitl) -> None:
    reposition, (x, y) = mav.MAV_CMD_DO_REPOSITION, degrees_e7(sitl, 2.0, 1.0)
    assert sitl.gcs.order_int(reposition, nan, nan, nan, pi, frame=RELATIVE, x=x, y=y, z=nan) == ACCEPTED
    sitl.run(3.5)
    assert sitl.position == pytest.approx((2.0, 1.0, 5.0), abs=0.05)
    assert turned_by(sitl, -0.5 * pi) < 0.1
    assert sitl.gcs.order_int(reposition, -1.0, 1.0, 0.0, nan, frame=RELATIVE, x=x, z=5.0) == DENIED


ORBITS = [
    (mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER, 3.0, pi),
    (mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE, -3.0, 0.5 * pi),
    (mav.ORBIT_YAW_BEHAVIOUR_HOLD_INITIAL_HEADING, -3.0, None),
]


@pytest.mark.parametrize(("behaviour", "radius", "look"), ORBITS)
def test_an_orbit_turns_both_ways_and_looks_as_told(
    sitl: Sitl, behaviour: int, radius: float, look: float | None
) -> None:
    assert orbit(sitl, radius, 2.0, float(behaviour)) == ACCEPTED
    sitl.run(5.0)
    x, y, z = sitl.position
    assert (hypot(x, y), z) == pytest.approx((3.0, 5.0), abs=0.1)
    vx, vy, _ = sitl.velocity
    assert x * vy - y * vx == pytest.approx(-radius * 2.0, abs=0.5)  # positive flies clockwise
    assert turned_by(sitl, 0.5 * pi if look is None else atan2(y, x) + look) < 0.1


@pytest.mark.long
def test_an_orbit_commanded_again_goes_on_where_it_is(sitl: Sitl) -> None:
    """Its height is above sea level, though the frame says above home: so MAVSDK sends it, and PX4 reads it."""
    x, y = degrees_e7(sitl, 5.0, 0.0)

    def turn(radius_m: float, speed_m_s: float) -> None:
        params, z = (radius_m, speed_m_s, nan, nan), sitl.origin.altitude_m + 6.0
        assert sitl.gcs.order_int(mav.MAV_CMD_DO_ORBIT, *params, frame=RELATIVE, x=x, y=y, z=z) == ACCEPTED

    def away_m() -> float:
        return hypot(sitl.position[0] - 5.0, sitl.position[1])

    turn(4.0, 2.0)
    sitl.run(3.5)
    turn(4.0, 3.0)
    sitl.hold(lambda: sitl.speed_m_s > 1.9, for_=2.0)
    assert sitl.speed_m_s == pytest.approx(3.0, abs=0.1)
    turn(-4.0, 3.0)
    sitl.hold(lambda: abs(away_m() - 4.0) < 0.2, for_=4.0)
    assert sitl.position[2] == pytest.approx(6.0, abs=0.05)
    turn(-2.0, 2.0)
    sitl.run(4.0)
    assert away_m() == pytest.approx(2.0, abs=0.15)
    sitl.select(Mode.HOLD)
    sitl.run(2.5)
    assert sitl.speed_m_s < 0.1


def test_headings_absolute_and_relative(sitl: Sitl) -> None:
    yaw = mav.MAV_CMD_CONDITION_YAW
    assert sitl.command(yaw, 90.0, 0.0, 0.0, 0.0) == ACCEPTED  # east
    sitl.run(3.5)
    assert turned_by(sitl, 0.0) < 0.02
    assert sitl.command(yaw, 30.0, 0.0, -1.0, 1.0) == ACCEPTED  # further to the left
    sitl.run(2.5)
    assert turned_by(sitl, pi / 6.0) < 0.02
    assert sitl.position == pytest.approx((0.0, 0.0, 5.0), abs=0.02)


def test_home_is_moved_here_and_there(sitl: Sitl) -> None:
    sitl.goto(3.0, 4.0, 5.0)
    sitl.run(1.5)
    home = mav.MAV_CMD_DO_SET_HOME
    x, y = degrees_e7(sitl, 1.0, -2.0)
    above_sea = sitl.origin.altitude_m + 0.5

    def move(x: int, y: int, z: float) -> int:
        return sitl.gcs.order_int(home, 0.0, 0.0, 0.0, 0.0, frame=RELATIVE, x=x, y=y, z=z)

    assert move(x, y, above_sea) == ACCEPTED
    sitl.wait_until(lambda: sitl.home == pytest.approx((1.0, -2.0, 0.5), abs=0.02), within=2.1)
    reported = sitl.gcs.latest("HOME_POSITION")
    assert (reported.latitude, reported.longitude) == pytest.approx((x, y), abs=2)
    for bad in ((950000000, y, 500.0), (x, y, nan), (0, 0, 500.0), (NOT_GIVEN, NOT_GIVEN, 500.0)):
        assert move(*bad) == DENIED
    assert sitl.inside.copter.pilot.home.position_enu_m == pytest.approx((1.0, -2.0, 0.5), abs=0.02)
    assert sitl.command(home, 1.0) == ACCEPTED
    assert sitl.inside.copter.pilot.home.position_enu_m == pytest.approx((3.0, 4.0, 5.0), abs=0.1)
    sitl.send("SET_GPS_GLOBAL_ORIGIN", SYSTEM, 473000000, 85000000, 500000)
    sitl.run(0.05)
    assert sitl.said("origin refused: the rotors are armed")
    assert sitl.inside.copter.pilot.home.origin == sitl.origin


@pytest.mark.sitl(airborne=None)
def test_the_origin_is_set_on_the_ground_to_the_digit(sitl: Sitl) -> None:
    sitl.send("SET_GPS_GLOBAL_ORIGIN", SYSTEM, 473000001, -85000003, 500004)
    sitl.run(0.05)
    reported = sitl.gcs.latest("GPS_GLOBAL_ORIGIN")
    assert (reported.latitude, reported.longitude, reported.altitude) == (473000001, -85000003, 500004)
    pilot = sitl.inside.copter.pilot
    assert pilot.home.origin == pytest.approx((47.3000001, -8.5000003, 500.004))

    def move(**place: float) -> int:
        return sitl.gcs.order_int(mav.MAV_CMD_DO_SET_GLOBAL_ORIGIN, frame=mav.MAV_FRAME_GLOBAL, **place)  # type: ignore[arg-type]

    assert move() == DENIED
    assert move(x=473977420, y=85455940, z=inf) == DENIED
    assert move(x=473977420, y=85455940, z=488.0) == ACCEPTED
    x, y = degrees_e7(sitl, 5.0, 5.0)
    sitl.send("SET_HOME_POSITION", SYSTEM, x, y, 490000, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0)
    sitl.run(0.05)
    assert pilot.home.position_enu_m == pytest.approx((5.0, 5.0, 2.0), abs=0.02)


@pytest.mark.sitl(airborne=None)
def test_no_takeoff_outside_the_geofence(sitl: Sitl) -> None:
    sitl.upload_fence(items.polygon([(20.0, 20.0), (30.0, 20.0), (30.0, 30.0)]))
    assert sitl.command(mav.MAV_CMD_NAV_TAKEOFF, *(nan,) * 7) == DENIED
    sitl.run(0.2)
    refused(sitl, "Arming denied: outside the geofence", sitl.arm)


@pytest.mark.sitl(airborne=None, params={"GF_MAX_VER_DIST": 8.0, "GF_MARGIN": 10.0})
def test_no_takeoff_where_the_margin_leaves_no_room(sitl: Sitl) -> None:
    sitl.run(1.0)
    refused(sitl, r"Arming denied: within 10 m \(GF_MARGIN\) of the geofence's edge", sitl.arm)


@pytest.mark.sitl(airborne=2.0, params={"RTL_RETURN_ALT": 2.0, "RTL_MIN_DIST": 1.0, "COM_DISARM_LAND": 0.1})
def test_return_leads_to_a_home_beyond_the_geofence(sitl: Sitl) -> None:
    sitl.goto(5.0, 0.0, 2.0)
    sitl.upload_fence(items.polygon([(4.0, -8.0), (9.0, -8.0), (9.0, 8.0), (4.0, 8.0)]))
    sitl.select(Mode.RETURN)
    sitl.wait_until(lambda: not sitl.armed, within=25.0)
    assert hypot(*sitl.position[:2]) < 0.1


def test_a_speed_parameter_acts_at_once(sitl: Sitl) -> None:
    sitl.goto(50.0, 0.0, 5.0, wait=False)
    sitl.run(2.5)
    sitl.set_param("MPC_XY_CRUISE", 2.0)
    sitl.run(2.0)
    assert sitl.speed_m_s == pytest.approx(2.0, abs=0.05)
    sitl.set_param("MPC_XY_VEL_MAX", 1.0)  # less than the cruise speed: that holds
    sitl.run(1.0)
    assert sitl.speed_m_s == pytest.approx(1.0, abs=0.05)
    sitl.set_param("MPC_LAND_SPEED", 0.3)
    sitl.set_param("MPC_Z_VEL_MAX_DN", 0.3)
    sitl.land(wait=False)
    sitl.run(3.0)
    assert sitl.velocity[2] == pytest.approx(-0.3, abs=0.03)


@pytest.mark.parametrize(
    ("name", "value"),
    [("MPC_JERK_MAX", 5.0), ("LPV_Q_POSITION", 50.0), ("LPV_POLE1", -5.0), ("VEH_MASS", 0.733), ("TRACK", 3)],
)
@pytest.mark.wind("3@270")
def test_a_parameter_that_changes_in_flight_jolts_nothing(sitl: Sitl, name: str, value: float) -> None:
    sitl.goto(30.0, 0.0, 5.0, wait=False)
    sitl.run(1.5)
    kind = mav.MAV_PARAM_TYPE_INT32 if isinstance(value, int) else mav.MAV_PARAM_TYPE_REAL32
    sent = Bits(value) if isinstance(value, int) else value
    sitl.gcs.send("PARAM_SET", SYSTEM, 1, name.encode(), sent, kind)
    tilts = [sitl.euler]
    sitl.run(0.5, lambda: tilts.append(sitl.euler))
    assert sitl.get_param(name) == pytest.approx(value, rel=1e-6)
    jolts = np.degrees(np.linalg.norm(np.diff(np.array(tilts), axis=0), axis=1))
    assert jolts.max() < 1.2
    sitl.run(1.0)
    assert sitl.velocity[0] > 3.0
