"""A vehicle that is steered from moment to moment: by a companion's setpoints, by sticks, by a target to follow."""

from itertools import pairwise
from math import atan2, cos, degrees, dist, hypot, nan, pi, radians, remainder, sin, tau

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, geodetic_of
from colibri.common.rotations import quaternion_from_euler
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.ned import ned_frd_from_enu_flu
from tools.harness.client import COMPONENT, SYSTEM
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight, in_the_air

EVERY_S = 0.1


def stream(flight: CopterFlight, seconds: float, **setpoint: object) -> None:
    """Fly for so long, with a setpoint ten times a second."""
    for _ in range(round(seconds / EVERY_S)):
        flight.setpoint(**setpoint)  # type: ignore[arg-type]
        flight.run(EVERY_S)


def offboard(**setpoint: object) -> CopterFlight:
    """Return a vehicle in the air, in offboard with that setpoint."""
    flight = in_the_air()
    stream(flight, EVERY_S, **setpoint)
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    return flight


def test_offboard_needs_setpoints_first() -> None:
    assert in_the_air().select(Mode.OFFBOARD) == DENIED


def test_offboard_positions_and_that_a_jump_of_them_is_flown_smoothly() -> None:
    flight = offboard(position=(0.0, 0.0, 5.0), yaw=0.5 * pi)
    stream(flight, 0.5, position=(0.0, 0.0, 5.0), yaw=0.5 * pi)  # it is there, to the last bit
    speeds = []
    for _ in range(45):
        flight.setpoint(position=(4.0, 2.0, 6.0), yaw=0.0)
        flight.run(EVERY_S, lambda: speeds.append(hypot(*flight.velocity)))
    assert max(speeds) < 5.2
    assert max(abs(after - before) for before, after in pairwise(speeds)) < 0.05
    assert flight.position == pytest.approx((4.0, 2.0, 6.0), abs=0.05)
    assert abs(flight.yaw_rad) < 0.05


def test_offboard_velocity_and_yaw_rate_and_what_silence_does() -> None:
    flight = offboard(velocity=(2.0, -1.0, 0.5), yaw_rate=0.5)
    stream(flight, 3.0, velocity=(2.0, -1.0, 0.5), yaw_rate=0.5)
    assert flight.velocity == pytest.approx((2.0, -1.0, 0.5), abs=0.05)
    assert flight.copter.pilot.context().state.rate_flu_rad_s[2] == pytest.approx(0.5, abs=0.05)
    flight.run(0.8)
    assert flight.reported_mode is Mode.OFFBOARD  # COM_OF_LOSS_T is 1 s
    flight.run(0.3)
    assert flight.mode is Mode.HOLD
    assert flight.client.said("setpoints lost: hold")
    flight.run(2.5)
    assert hypot(*flight.velocity) < 0.1


def test_no_velocity_or_acceleration_leads_beyond_what_is_allowed() -> None:
    flight = in_the_air(values={"MPC_XY_VEL_MAX": 4.0})
    stream(flight, EVERY_S, velocity=(30.0, 30.0, 20.0))
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    stream(flight, 3.0, velocity=(30.0, 30.0, 20.0))
    reference = flight.copter.pilot.context().velocity
    assert 3.9 < hypot(*reference[:2]) <= 4.01  # MPC_XY_VEL_MAX
    assert 2.9 < reference[2] <= 3.01
    stream(flight, 4.0, acceleration=(-40.0, 0.0, -9.0))
    reference = flight.copter.pilot.context().velocity
    assert -4.01 <= reference[0] < -3.5
    assert -1.51 <= reference[2] < -1.2


def test_offboard_acceleration() -> None:
    flight = offboard(acceleration=(1.0, 0.0, 0.0))
    stream(flight, 1.0, acceleration=(1.0, 0.0, 0.0))
    before = flight.velocity[0]
    stream(flight, 1.0, acceleration=(1.0, 0.0, 0.0))
    assert flight.velocity[0] - before == pytest.approx(1.0, abs=0.1)


def test_offboard_velocity_along_the_body_turns_with_it() -> None:
    flight = in_the_air()  # looks north

    def send(seconds: float, yaw_rate: float) -> None:
        for _ in range(round(seconds / EVERY_S)):
            fields = (mav.MAV_FRAME_BODY_NED, 0x5C7, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, yaw_rate)
            flight.send("SET_POSITION_TARGET_LOCAL_NED", 0, SYSTEM, COMPONENT, *fields)
            flight.run(EVERY_S)

    send(EVERY_S, 0.0)
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    send(2.5, 0.0)
    assert flight.velocity == pytest.approx((0.0, 2.0, 0.0), abs=0.05)
    send(3.0, 0.5)  # clockwise
    vx, vy, _ = flight.velocity
    assert hypot(vx, vy) == pytest.approx(2.0, abs=0.2)
    assert abs(remainder(atan2(vy, vx) - flight.yaw_rad, tau)) < 0.25


def attitude(flight: CopterFlight, seconds: float, mask: int, q: Quaternion, rates: Vector, thrust: float) -> None:
    for _ in range(round(seconds / EVERY_S)):
        wire = ned_frd_from_enu_flu(q)
        flight.send("SET_ATTITUDE_TARGET", 0, SYSTEM, COMPONENT, mask, list(wire), *rates, thrust)
        flight.run(EVERY_S)


def test_offboard_attitude_then_rates_then_silence() -> None:
    flight = in_the_air(20.0)
    tilted = quaternion_from_euler(radians(10.0), 0.0, 0.5 * pi)
    attitude(flight, EVERY_S, 7, tilted, (0.0, 0.0, 0.0), 0.5)
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    attitude(flight, 1.0, 7, tilted, (0.0, 0.0, 0.0), 0.5)
    assert degrees(flight.euler[0]) == pytest.approx(10.0, abs=0.5)
    assert degrees(flight.euler[1]) == pytest.approx(0.0, abs=0.5)
    attitude(flight, 0.5, 0x80, tilted, (0.0, 0.0, -1.0), 0.5)  # FRD: to the left
    assert flight.copter.pilot.context().state.rate_flu_rad_s[2] == pytest.approx(1.0, abs=0.1)
    attitude(flight, 0.5, 0x80 | 0x40, tilted, (0.0, 0.0, 0.0), nan)  # no thrust is asked for: the weight's
    assert flight.copter.pilot.ground.standing is False
    flight.run(1.1)
    assert flight.mode is Mode.HOLD
    flight.run(3.0)
    assert hypot(*flight.velocity) < 0.3


def test_attitude_without_thrust_lifts_nothing_off_the_ground() -> None:
    flight = CopterFlight()
    level = quaternion_from_euler(0.0, 0.0, 0.0)
    attitude(flight, EVERY_S, 0x40 | 7, level, (0.0, 0.0, 0.0), 0.0)
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    assert flight.arm() == ACCEPTED
    attitude(flight, 0.5, 0x40 | 7, level, (0.0, 0.0, 0.0), 0.0)
    assert flight.copter.pilot.ground.standing
    attitude(flight, 1.0, 7, level, (0.0, 0.0, 0.0), 0.6)
    assert flight.position[2] > 0.2


def sticks(flight: CopterFlight, seconds: float, **deflections: float) -> None:
    for _ in range(round(seconds / EVERY_S)):
        flight.stick(**deflections)
        flight.run(EVERY_S)


def by_hand(mode: Mode, height_m: float = 5.0, **values: float) -> CopterFlight:
    flight = in_the_air(height_m, values=values)
    sticks(flight, EVERY_S)
    assert flight.select(mode) == ACCEPTED
    return flight


def test_position_by_hand() -> None:
    flight = by_hand(Mode.POSITION)
    sticks(flight, 2.5, pitch=0.525)  # half, beyond the dead zone: north
    assert flight.velocity == pytest.approx((0.0, 2.5, 0.0), abs=0.1)
    sticks(flight, 3.0)
    held = flight.position
    sticks(flight, 0.5)
    assert dist(flight.position, held) < 0.05
    sticks(flight, 1.5, yaw=1.0)
    assert flight.copter.pilot.context().state.rate_flu_rad_s[2] == pytest.approx(-radians(120.0), abs=0.1)
    sticks(flight, 1.0, thrust=1.0)
    assert flight.velocity[2] > 2.0
    flight.run(0.6)
    assert flight.mode is Mode.HOLD
    assert flight.client.said("sticks lost: hold")


def test_from_rest_a_full_stick_is_flown_smoothly() -> None:
    """The reference stands on its place to the last bit when the stick moves."""
    flight = by_hand(Mode.POSITION)
    sticks(flight, 1.0)
    steepest = []
    for _ in range(10):
        flight.stick(pitch=1.0, roll=1.0)
        flight.run(EVERY_S, lambda: steepest.append(max(map(abs, flight.euler[:2]))))
    assert degrees(max(steepest)) < 25.0  # 3 m/s² lean by 17 degrees


def test_sticks_that_are_held_when_the_mode_begins_are_flown() -> None:
    flight = in_the_air()
    sticks(flight, EVERY_S, roll=-1.0)
    assert flight.select(Mode.POSITION) == ACCEPTED
    sticks(flight, 2.5, roll=-1.0)
    assert flight.velocity == pytest.approx((-5.0, 0.0, 0.0), abs=0.2)


def test_altitude_by_hand() -> None:
    flight = by_hand(Mode.ALTITUDE, MPC_MAN_TILT_MAX=20.0)
    sticks(flight, 1.0, roll=1.0)
    assert degrees(flight.euler[0]) == pytest.approx(20.0, abs=1.0)
    sticks(flight, 0.7)
    assert degrees(flight.euler[0]) == pytest.approx(0.0, abs=1.0)
    assert flight.position[2] == pytest.approx(5.0, abs=0.15)
    sticks(flight, 1.5, thrust=1.0)
    assert flight.velocity[2] == pytest.approx(3.0, abs=0.3)
    flight.run(0.6)
    assert flight.mode is Mode.HOLD


def test_stabilized_by_hand() -> None:
    flight = by_hand(Mode.STABILIZED, 20.0, MPC_MAN_TILT_MAX=15.0, MPC_MAN_Y_MAX=60.0)
    sticks(flight, 0.8, pitch=1.0, yaw=-1.0)
    assert degrees(hypot(*flight.euler[:2])) == pytest.approx(15.0, abs=1.5)
    assert flight.copter.pilot.context().state.rate_flu_rad_s[2] == pytest.approx(radians(60.0), abs=0.1)
    sticks(flight, 0.8)
    assert abs(flight.velocity[2]) < 0.5
    sticks(flight, 0.5, thrust=0.0)
    assert flight.velocity[2] < -3.0
    flight.run(0.6)
    assert flight.mode is Mode.HOLD
    flight.run(3.0)
    assert flight.position[2] > 2.0
    assert hypot(*flight.velocity) < 0.3


def test_from_the_ground_and_back_by_hand() -> None:
    flight = CopterFlight()
    sticks(flight, EVERY_S)
    assert flight.select(Mode.ALTITUDE) == ACCEPTED
    sticks(flight, EVERY_S)
    assert flight.arm() == ACCEPTED
    sticks(flight, 0.5)
    assert flight.copter.pilot.ground.standing
    sticks(flight, 1.0, thrust=0.9)
    assert flight.position[2] > 0.5
    for _ in range(80):
        sticks(flight, EVERY_S, thrust=0.2)
        if not flight.armed:
            break
    assert flight.client.said("landing detected")
    assert not flight.armed


def target(flight: CopterFlight, place: Vector, velocity: Vector = (0.0, 0.0, 0.0)) -> None:
    there = geodetic_of(place, DEFAULT_ORIGIN)
    latitude, longitude = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
    ned = [velocity[1], velocity[0], -velocity[2]]
    none = [0.0, 0.0, 0.0]
    fields = (0, 3, latitude, longitude, there.altitude_m, ned, none, [1.0, 0.0, 0.0, 0.0], none, none, 0)
    flight.send("FOLLOW_TARGET", *fields)


def test_it_follows_behind_a_target_looks_at_it_and_stops_with_it() -> None:
    values = {"FLW_TGT_DST": 4.0, "FLW_TGT_HT": 3.0}
    flight = in_the_air(3.0, values=values)
    target(flight, (2.0, 0.0, 0.0))
    flight.run(0.05)
    assert flight.select(Mode.FOLLOW) == ACCEPTED
    x = 2.0
    for _ in range(10):
        target(flight, (x, 0.0, 0.0), (2.0, 0.0, 0.0))
        flight.run(0.5)
        x += 1.0
    assert flight.position == pytest.approx((x - 4.0, 0.0, 3.0), abs=0.15)
    assert flight.velocity == pytest.approx((2.0, 0.0, 0.0), abs=0.1)
    assert abs(flight.yaw_rad) < 0.05
    target(flight, (x, 0.0, 0.0))
    flight.run(3.5)
    assert flight.position == pytest.approx((x - 4.0, 0.0, 3.0), abs=0.15)


def test_a_target_as_fast_as_a_train_is_not_raced() -> None:
    flight = in_the_air(8.0)
    target(flight, (10.0, 0.0, 0.0), (95.0, 0.0, 0.0))
    flight.run(0.05)
    assert flight.select(Mode.FOLLOW) == ACCEPTED
    flight.run(4.0)
    assert hypot(*flight.copter.pilot.context().velocity) < 18.0


def test_without_a_target_follow_stops() -> None:
    flight = in_the_air()
    flight.goto(30.0, 0.0, 5.0)
    flight.run(2.0)
    assert flight.select(Mode.FOLLOW) == ACCEPTED
    flight.run(3.0)
    assert hypot(*flight.velocity) < 0.1
    assert cos(flight.yaw_rad) > sin(0.5)
