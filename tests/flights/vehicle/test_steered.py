"""A vehicle that is steered from moment to moment: by a companion's setpoints, by sticks, by a target to follow."""

from itertools import pairwise
from math import atan2, cos, degrees, dist, hypot, nan, pi, radians, remainder, sin, tau
from typing import Any

import pytest

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.autopilot.guidance.tasks.follow import ABOVE_TARGET, MIN_HEIGHT_M
from colibri.common.earth.geodesy import geodetic_of
from colibri.common.rotations import quaternion_from_euler
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED, COMPONENT, EVERY_S, QUICK, SYSTEM, refused, stream

pytestmark = [QUICK, pytest.mark.sitl(airborne=5.0)]
HERE: Vector = (0.0, 0.0, 5.0)
STILL: Vector = (0.0, 0.0, 0.0)
REDUCED_TILT = {"MPC_MAN_TILT_MAX": 20.0}


def fly_by(sitl: Sitl, seconds: float, **setpoint: Any) -> None:
    stream(sitl, EVERY_S, lambda: sitl.setpoint(**setpoint))
    if sitl.mode is not Mode.OFFBOARD:
        sitl.select(Mode.OFFBOARD)
    stream(sitl, seconds, lambda: sitl.setpoint(**setpoint))


def steer(sitl: Sitl, seconds: float, mode: Mode | None = None, **axes: float) -> None:
    """Hold the sticks for so long, and go over to a mode first."""
    with sitl.sticks_held(**axes):
        if mode is not None:
            sitl.run(0.05)
            sitl.select(mode)
        sitl.run(seconds)


def test_a_jump_of_the_setpoint_is_flown_smoothly(sitl: Sitl) -> None:
    fly_by(sitl, 0.5, position=HERE, yaw=0.5 * pi)  # it is there, to the last bit
    speeds = []
    for _ in range(45):
        sitl.setpoint(position=(4.0, 2.0, 6.0), yaw=0.0)
        sitl.run(EVERY_S, lambda: speeds.append(sitl.speed_m_s))
    assert max(speeds) < 5.2
    assert max(abs(after - before) for before, after in pairwise(speeds)) < 0.05
    assert sitl.position == pytest.approx((4.0, 2.0, 6.0), abs=0.05)
    assert abs(sitl.euler[2]) < 0.05


@pytest.mark.sitl(params={"MPC_XY_VEL_MAX": 4.0})
def test_velocity_and_acceleration_stay_within_limits(sitl: Sitl) -> None:
    fly_by(sitl, 3.0, velocity=(30.0, 30.0, 20.0))
    pilot = sitl.inside.copter.pilot
    assert 3.9 < hypot(*pilot.context().velocity[:2]) <= 4.01
    assert 2.9 < pilot.context().velocity[2] <= 3.01
    fly_by(sitl, 4.0, acceleration=(-40.0, 0.0, -9.0))
    east, _, up = pilot.context().velocity
    assert -4.01 <= east < -3.5
    assert -1.51 <= up < -1.2


def test_offboard_velocity_along_the_body_turns_with_it(sitl: Sitl) -> None:
    def send(yaw_rate: float) -> None:
        fields = (mav.MAV_FRAME_BODY_NED, 0x5C7, 0.0, 0.0, 0.0, 2.0, *(0.0,) * 6, yaw_rate)
        sitl.send("SET_POSITION_TARGET_LOCAL_NED", 0, SYSTEM, COMPONENT, *fields)

    stream(sitl, EVERY_S, lambda: send(0.0))
    sitl.select(Mode.OFFBOARD)
    stream(sitl, 2.5, lambda: send(0.0))
    assert sitl.velocity == pytest.approx((0.0, 2.0, 0.0), abs=0.05)  # it looks north
    stream(sitl, 3.0, lambda: send(0.5))  # clockwise
    vx, vy, _ = sitl.velocity
    assert hypot(vx, vy) == pytest.approx(2.0, abs=0.2)
    assert abs(remainder(atan2(vy, vx) - sitl.euler[2], tau)) < 0.25


def attitude(sitl: Sitl, seconds: float, mask: int, q: Quaternion, rates: Vector, thrust: float) -> None:
    fields = (0, SYSTEM, COMPONENT, mask, list(ned_frd_from_enu_flu(q)), *rates, thrust)
    stream(sitl, seconds, lambda: sitl.send("SET_ATTITUDE_TARGET", *fields))


@pytest.mark.sitl(airborne=20.0)
def test_offboard_attitude_then_rates_then_silence(sitl: Sitl) -> None:
    tilted = quaternion_from_euler(radians(10.0), 0.0, 0.5 * pi)
    attitude(sitl, EVERY_S, 7, tilted, STILL, 0.5)
    sitl.select(Mode.OFFBOARD)
    attitude(sitl, 1.0, 7, tilted, STILL, 0.5)
    assert [degrees(angle) for angle in sitl.euler[:2]] == pytest.approx([10.0, 0.0], abs=0.5)
    attitude(sitl, 0.5, 0x80, tilted, (0.0, 0.0, -1.0), 0.5)  # FRD: to the left
    assert sitl.rates[2] == pytest.approx(1.0, abs=0.1)
    attitude(sitl, 0.5, 0x80 | 0x40, tilted, STILL, nan)  # no thrust is requested: the weight's
    assert not sitl.inside.copter.pilot.ground.standing
    sitl.run(1.1)
    assert sitl.mode is Mode.HOLD
    sitl.run(3.0)
    assert sitl.speed_m_s < 0.3


@pytest.mark.sitl(profile="agile", airborne=40.0)
@pytest.mark.parametrize(
    "inverted",
    [quaternion_from_euler(pi, 0.0, 0.5 * pi), quaternion_from_euler(0.0, pi, 0.5 * pi)],
    ids=["roll", "pitch"],
)
def test_a_law_without_a_tilt_limit_flips(sitl: Sitl, inverted: Quaternion) -> None:
    level = quaternion_from_euler(0.0, 0.0, 0.5 * pi)
    attitude(sitl, EVERY_S, 7, level, STILL, 0.5)
    sitl.select(Mode.OFFBOARD)
    attitude(sitl, 0.3, 7, level, STILL, 1.0)
    attitude(sitl, 0.55, 7, inverted, STILL, 0.05)
    phi, theta, _ = sitl.euler
    assert cos(phi) * cos(theta) < cos(radians(170.0))
    attitude(sitl, 0.8, 7, level, STILL, 1.0)
    assert [degrees(angle) for angle in sitl.euler[:2]] == pytest.approx([0.0, 0.0], abs=6.0)
    assert sitl.position[2] > 37.0


@pytest.mark.sitl(airborne=None)
def test_attitude_without_thrust_lifts_nothing(sitl: Sitl) -> None:
    level = quaternion_from_euler(0.0, 0.0, 0.0)
    attitude(sitl, EVERY_S, 0x40 | 7, level, STILL, 0.0)
    sitl.select(Mode.OFFBOARD)
    sitl.arm()
    attitude(sitl, 0.5, 0x40 | 7, level, STILL, 0.0)
    assert sitl.inside.copter.pilot.ground.standing
    attitude(sitl, 1.0, 7, level, STILL, 0.6)
    assert sitl.position[2] > 0.2


@pytest.mark.parametrize("mode", [Mode.OFFBOARD, Mode.POSITION, Mode.ALTITUDE, Mode.STABILIZED])
def test_a_mode_needs_its_stream_and_begins_with_it(sitl: Sitl, mode: Mode) -> None:
    """Clients do not wait between the first message and the mode: both may come between two control samples."""
    reason = "send them before the mode" if mode is Mode.OFFBOARD else "no MANUAL_CONTROL received"
    refused(sitl, reason, sitl.select, mode)
    if mode is Mode.OFFBOARD:
        sitl.setpoint(position=HERE)
    else:
        sitl.stick()
    number = custom_mode(mode)
    assert sitl.command(mav.MAV_CMD_DO_SET_MODE, 1.0, number >> 16 & 0xFF, number >> 24 & 0xFF) == ACCEPTED
    assert sitl.mode is mode


def test_position_by_hand(sitl: Sitl) -> None:
    steer(sitl, 3.0, Mode.POSITION, pitch=0.525)  # half, beyond the dead zone: along the heading, north
    assert sitl.velocity == pytest.approx((0.0, 2.5, 0.0), abs=0.1)
    steer(sitl, 3.0)
    held = sitl.position
    steer(sitl, 1.0)
    assert dist(sitl.position, held) < 0.02
    steer(sitl, 1.5, yaw=1.0)
    assert sitl.rates[2] == pytest.approx(-radians(120.0), abs=0.1)  # clockwise
    steer(sitl, 1.5, thrust=1.0)
    assert sitl.velocity[2] == pytest.approx(3.0, abs=0.3)


def test_from_rest_a_full_stick_is_flown_smoothly(sitl: Sitl) -> None:
    """The reference stands on its place to the last bit when the stick moves."""
    steer(sitl, 1.0, Mode.POSITION)
    steepest = []
    with sitl.sticks_held(pitch=1.0, roll=1.0):
        sitl.run(1.0, lambda: steepest.append(max(map(abs, sitl.euler[:2]))))
    assert degrees(max(steepest)) < 25.0  # 3 m/s² lean by 17 degrees


@pytest.mark.sitl(params=REDUCED_TILT)
def test_altitude_by_hand(sitl: Sitl) -> None:
    steer(sitl, 1.0, Mode.ALTITUDE, roll=1.0)
    assert degrees(sitl.euler[0]) == pytest.approx(20.0, abs=1.0)
    steer(sitl, 0.7)
    assert degrees(sitl.euler[0]) == pytest.approx(0.0, abs=1.0)
    assert sitl.position[2] == pytest.approx(5.0, abs=0.15)
    steer(sitl, 1.5, thrust=1.0)
    assert sitl.velocity[2] == pytest.approx(3.0, abs=0.3)


@pytest.mark.sitl(airborne=20.0)
def test_stabilized_by_hand(sitl: Sitl) -> None:
    steer(sitl, 1.0, Mode.STABILIZED, pitch=0.5)
    assert degrees(sitl.euler[1]) == pytest.approx(17.5, abs=1.0)  # of 35 degrees
    sitl.set_param("MPC_MAN_TILT_MAX", 15.0)
    sitl.set_param("MPC_MAN_Y_MAX", 60.0)
    steer(sitl, 0.8, Mode.STABILIZED, pitch=1.0, yaw=-1.0)
    assert degrees(hypot(*sitl.euler[:2])) == pytest.approx(15.0, abs=1.5)
    assert sitl.rates[2] == pytest.approx(radians(60.0), abs=0.1)
    steer(sitl, 0.8)
    assert abs(sitl.velocity[2]) < 0.5
    steer(sitl, 0.5, thrust=0.0)
    assert sitl.velocity[2] < -3.0
    sinks_m_s = -sitl.velocity[2]
    steer(sitl, 0.3, thrust=0.8)
    assert sitl.velocity[2] > 1.0 - sinks_m_s
    sitl.run(3.6)
    assert sitl.mode is Mode.HOLD
    assert sitl.position[2] > 2.0
    assert sitl.speed_m_s < 0.3


@pytest.mark.parametrize("mode", [Mode.ALTITUDE, pytest.param(Mode.POSITION, marks=pytest.mark.long)])
@pytest.mark.sitl(airborne=None)
def test_takeoff_and_landing_by_hand(sitl: Sitl, mode: Mode) -> None:
    steer(sitl, EVERY_S, mode)
    with sitl.sticks_held():
        sitl.arm()
        sitl.run(0.5)
    assert sitl.inside.copter.pilot.ground.standing
    steer(sitl, 1.0, thrust=0.9)
    assert sitl.position[2] > 0.5
    with sitl.sticks_held(thrust=0.2):
        sitl.wait_until(lambda: not sitl.armed, within=8.0)
    assert sitl.said("Landing detected")


def target(sitl: Sitl, place: Vector, velocity: Vector = STILL) -> None:
    there = geodetic_of(place, sitl.origin)
    latitude, longitude = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
    ned = [velocity[1], velocity[0], -velocity[2]]
    attitude = [1.0, 0.0, 0.0, 0.0]
    sitl.send("FOLLOW_TARGET", 0, 3, latitude, longitude, there.altitude_m, ned, STILL, attitude, STILL, STILL, 0)


@pytest.mark.parametrize(
    ("above", "target_up_m", "height_m"),
    [(0, 3.0, 8.0), (ABOVE_TARGET, 3.0, 11.0), (ABOVE_TARGET, -8.0, MIN_HEIGHT_M)],
    ids=["above home", "above the target", "never into the ground"],
)
@pytest.mark.sitl(airborne=8.0, params={"FLW_TGT_DST": 2.0, "FLW_TGT_HT": 8.0})
def test_the_target_is_followed_at_its_distance(sitl: Sitl, above: int, target_up_m: float, height_m: float) -> None:
    sitl.set_param("FLW_TGT_ALT_M", above)
    sitl.select(Mode.FOLLOW)
    for _ in range(6):
        target(sitl, (5.0, 0.0, target_up_m))
        sitl.run(1.0)
    assert sitl.mode is Mode.FOLLOW
    east, north, up = sitl.position
    assert hypot(east - 5.0, north) == pytest.approx(2.0, abs=0.1)
    assert up == pytest.approx(height_m, abs=0.1)


@pytest.mark.sitl(airborne=3.0, params={"FLW_TGT_DST": 4.0, "FLW_TGT_HT": 3.0})
def test_a_moving_target_is_followed_until_it_stops(sitl: Sitl) -> None:
    x = 2.0
    target(sitl, (x, 0.0, 0.0))
    sitl.run(0.05)
    sitl.select(Mode.FOLLOW)
    for _ in range(10):
        target(sitl, (x, 0.0, 0.0), (2.0, 0.0, 0.0))
        sitl.run(0.5)
        x += 1.0
    assert sitl.position == pytest.approx((x - 4.0, 0.0, 3.0), abs=0.15)
    assert sitl.velocity == pytest.approx((2.0, 0.0, 0.0), abs=0.1)
    assert abs(sitl.euler[2]) < 0.05
    target(sitl, (x, 0.0, 0.0))
    sitl.run(3.5)
    assert sitl.position == pytest.approx((x - 4.0, 0.0, 3.0), abs=0.15)


@pytest.mark.sitl(airborne=8.0)
def test_a_target_as_fast_as_a_train_is_not_raced(sitl: Sitl) -> None:
    target(sitl, (10.0, 0.0, 0.0), (95.0, 0.0, 0.0))
    sitl.run(0.05)
    sitl.select(Mode.FOLLOW)
    sitl.run(4.0)
    assert hypot(*sitl.inside.copter.pilot.context().velocity) < 18.0


def test_without_a_target_follow_stops(sitl: Sitl) -> None:
    sitl.goto(30.0, 0.0, 5.0, wait=False)
    sitl.run(2.0)
    sitl.select(Mode.FOLLOW)
    sitl.run(3.0)
    assert sitl.speed_m_s < 0.1
    assert cos(sitl.euler[2]) > sin(0.5)
