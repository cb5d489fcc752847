"""A vehicle flown over MAVLink: arming, take-off, landing, disarming, return."""

from math import degrees, hypot, nan

import pytest

from colibri.autopilot.commander.rules.modes import FIRST, Mode, State
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.start import Start
from colibri.sitl.vehicle import FORCE
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight

ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM


def test_arming_and_disarming_on_the_ground() -> None:
    flight = CopterFlight()
    assert not flight.armed
    assert flight.reported_mode is Mode.HOLD
    assert flight.arm() == ACCEPTED
    flight.run(1.1)
    assert flight.client.latest("HEARTBEAT").base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
    assert flight.world.rotor_speeds == pytest.approx((83.8,) * 4, rel=0.01)  # idle
    assert flight.arm() == ACCEPTED  # already
    assert flight.disarm() == ACCEPTED
    flight.run(0.5)
    assert max(flight.world.rotor_speeds) < 1.0
    assert flight.disarm() == ACCEPTED  # already
    for param in (2.0, 0.5, -1.0, nan, 1e30):
        assert flight.command(ARM, param) == DENIED
    assert flight.client.said("rotors armed")
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize(
    ("start", "reason"),
    [
        (Start(z=0.2, phi=60.0), "tilted by"),
        (Start(z=0.4, vx=2.0), "moving at"),
        (Start(z=0.4, vx=2.0), "not standing on the ground"),
    ],
)
def test_a_check_that_fails_refuses_arming_and_says_why(start: Start, reason: str) -> None:
    flight = CopterFlight()
    flight.reset_world(start)
    flight.copter.pilot.ground.take_off(0)
    flight.run(0.03)
    assert flight.arm() == DENIED
    assert flight.client.said("not armed: ")
    assert flight.client.said(reason)
    assert flight.command(mav.MAV_CMD_RUN_PREARM_CHECKS) == mav.MAV_RESULT_FAILED
    assert flight.arm(force=True) == ACCEPTED


def test_an_empty_battery_refuses_arming() -> None:
    flight = CopterFlight()
    flight.drain(0.95)
    flight.run(0.03)
    assert flight.arm() == DENIED
    assert flight.client.said("battery at 5%")


def test_sticks_that_are_not_heard_or_up_refuse_arming() -> None:
    flight = CopterFlight()
    assert flight.select(Mode.POSITION) == ACCEPTED  # on the ground it need not be met yet
    assert flight.arm() == DENIED
    assert flight.client.said("no MANUAL_CONTROL is heard")
    flight.stick(thrust=0.9)
    flight.run(0.03)
    assert flight.arm() == DENIED
    assert flight.client.said("thrust stick is up")
    flight.stick(thrust=0.5)
    flight.run(0.03)
    assert flight.arm() == ACCEPTED


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.RETURN])
def test_a_mode_that_ends_on_the_ground_refuses_arming(mode: Mode) -> None:
    flight = CopterFlight()
    assert flight.select(mode) == ACCEPTED
    assert flight.arm() == DENIED
    assert flight.client.said("choose another mode first")


def test_take_off_hover_and_land() -> None:
    flight = CopterFlight()
    flight.run(0.6)
    assert flight.client.latest("EXTENDED_SYS_STATE").landed_state == mav.MAV_LANDED_STATE_ON_GROUND
    assert flight.arm() == ACCEPTED
    assert flight.command(mav.MAV_CMD_NAV_TAKEOFF, *(nan,) * 7) == ACCEPTED
    assert flight.mode is Mode.TAKEOFF
    flight.wait_until(lambda: flight.position[2] > 0.5, within=3.0)
    flight.run(0.6)
    assert flight.client.latest("EXTENDED_SYS_STATE").landed_state == mav.MAV_LANDED_STATE_TAKEOFF
    assert max(z for _, _, z in flight.path(4.0)) < 2.51
    assert flight.reported_mode is Mode.HOLD
    assert flight.position == pytest.approx((0.0, 0.0, 2.5), abs=0.01)
    assert flight.client.latest("EXTENDED_SYS_STATE").landed_state == mav.MAV_LANDED_STATE_IN_AIR
    assert flight.disarm() == DENIED
    assert flight.client.said("not disarmed: the vehicle is flying")
    assert flight.armed
    assert flight.command(mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan) == ACCEPTED
    flight.wait_until(lambda: flight.position[2] < 0.05, within=5.0)
    assert flight.velocity[2] == pytest.approx(-0.7, abs=0.05)  # MPC_LAND_SPEED
    flight.wait_until(lambda: flight.client.said("landing detected"), within=2.0)
    landed_s = flight.time_s
    flight.wait_until(lambda: not flight.armed, within=5.0)
    assert flight.time_s - landed_s == pytest.approx(2.0, abs=0.02)  # COM_DISARM_LAND
    assert flight.copter.pilot.state == FIRST
    assert flight.client.said("landed, rotors stopped")
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=0.02)


def test_who_does_not_take_off_is_disarmed() -> None:
    flight = CopterFlight(values={"COM_DISARM_PRFLT": 3.0})
    assert flight.arm() == ACCEPTED
    assert flight.wait_until(lambda: not flight.armed, within=5.0) == pytest.approx(3.0, abs=0.05)
    assert flight.client.said("no take-off, rotors stopped")


def test_the_height_commanded_before_arming_is_flown() -> None:
    """As QGroundControl does: the take-off above sea level first, then the arming."""
    flight = CopterFlight()
    above_sea = DEFAULT_ORIGIN.altitude_m + 1.5
    assert flight.command(mav.MAV_CMD_NAV_TAKEOFF, -1.0, 0.0, 0.0, nan, nan, nan, above_sea) == ACCEPTED
    assert flight.arm() == ACCEPTED
    flight.wait_until(lambda: flight.mode is Mode.HOLD, within=6.0)
    flight.run(2.0)
    assert flight.position[2] == pytest.approx(1.5, abs=0.03)
    flight.land()
    assert flight.arm() == ACCEPTED  # that height is forgotten: nothing asks for another take-off
    flight.run(1.0)
    assert flight.position[2] == pytest.approx(0.0, abs=0.01)


def test_a_take_off_in_the_air_climbs_or_stays_but_never_sinks() -> None:
    flight = CopterFlight()
    flight.takeoff(1.5)
    before = flight.position[2]
    assert flight.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, 1.0) == ACCEPTED
    assert min(z for _, _, z in flight.path(1.0)) > before - 0.01
    assert flight.mode is Mode.HOLD
    assert flight.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, 2.0) == ACCEPTED
    flight.run(3.0)
    assert flight.position[2] == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("height", [0.0, -5.0, 1e6, float("inf"), -1e30])
def test_a_take_off_to_nowhere_is_denied(height: float) -> None:
    flight = CopterFlight()
    assert flight.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, height) == DENIED
    assert flight.mode is Mode.HOLD


@pytest.mark.parametrize("command", [(ARM, 0.0, FORCE), (mav.MAV_CMD_DO_FLIGHTTERMINATION, 1.0)])
def test_force_stops_the_rotors_in_the_air_and_it_can_be_armed_again(command: tuple[float, ...]) -> None:
    flight = CopterFlight()
    flight.takeoff(2.0)
    assert flight.command(int(command[0]), *command[1:]) == ACCEPTED
    assert not flight.armed
    assert flight.client.said("rotors stopped in the air")
    assert flight.arm() == DENIED
    assert flight.wait_until(lambda: flight.copter.pilot.ground.standing, within=5.0) > 0.6
    assert not any(flight.rotors.controls)
    assert flight.arm() == ACCEPTED
    flight.run(0.5)
    assert flight.position[2] < 0.1


def test_armed_by_force_in_the_fall_it_catches_itself() -> None:
    flight = CopterFlight()
    flight.takeoff(1.0)
    assert flight.disarm(force=True) == ACCEPTED
    flight.reset_world(Start(z=20.0, vx=2.0, vz=-5.0, p=1.0))
    flight.run(0.2)
    assert flight.velocity[2] < -6.0
    assert flight.arm(force=True) == ACCEPTED
    flight.run(3.0)
    assert flight.position[2] > 10.0
    assert hypot(*flight.velocity) < 0.1


def test_disarmed_by_hand_after_a_landing_it_can_be_armed_at_once() -> None:
    flight = CopterFlight()
    flight.takeoff(1.0)
    assert flight.select(Mode.LAND) == ACCEPTED
    flight.wait_until(lambda: flight.copter.pilot.ground.standing, within=8.0)
    assert flight.disarm() == ACCEPTED
    assert flight.mode is Mode.HOLD
    assert flight.arm() == ACCEPTED


def test_return_climbs_flies_home_lands_and_disarms() -> None:
    flight = CopterFlight(values={"RTL_RETURN_ALT": 4.0, "RTL_MIN_DIST": 2.0, "COM_DISARM_LAND": 0.2})
    flight.takeoff(2.0)
    assert flight.goto(4.0, -3.0, 2.0) == ACCEPTED
    flight.wait_until(lambda: flight.position[0] > 3.9 and hypot(*flight.velocity) < 0.2, within=10.0)
    assert flight.command(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    assert flight.mode is Mode.RETURN
    path = flight.path_until(lambda: not flight.armed, 40.0)
    highest = max(z for _, _, z in path)
    assert 3.7 < highest < 4.05
    low_and_far = [place for place in path if hypot(place[0], place[1]) > 1.0 and place[2] < 3.5]
    assert all(hypot(x - 4.0, y + 3.0) < 0.5 for x, y, _ in low_and_far)
    assert hypot(*flight.position[:2]) < 0.1


def test_close_to_home_it_returns_without_a_climb() -> None:
    flight = CopterFlight(values={"COM_DISARM_LAND": 0.2})
    flight.takeoff(1.0)
    assert flight.goto(2.0, 0.0, 1.0) == ACCEPTED
    flight.run(2.0)
    assert flight.select(Mode.RETURN) == ACCEPTED
    path = flight.path_until(lambda: not flight.armed, 20.0)
    assert max(z for _, _, z in path) < 1.1
    assert hypot(*flight.position[:2]) < 0.1


def test_in_wind_it_lands_where_it_was_told_to() -> None:
    flight = CopterFlight(wind_enu_m_s=(-5.0, 3.0, 0.0), values={"COM_DISARM_LAND": 0.2})
    flight.takeoff(1.5)
    assert hypot(*flight.position[:2]) < 0.3
    assert flight.select(Mode.LAND) == ACCEPTED
    path = flight.path_until(lambda: not flight.armed, 20.0)
    assert max(hypot(x, y) for x, y, _ in path) < 0.3
    assert abs(degrees(flight.euler[0])) < 1.0


def test_the_autopilot_restarted_in_mid_air_picks_the_flight_up_in_hold() -> None:
    flight = CopterFlight()
    flight.takeoff(1.0)
    assert flight.goto(20.0, 0.0, 1.0) == ACCEPTED
    flight.wait_until(lambda: flight.velocity[0] > 3.0, within=5.0)
    flight.restart()
    flight.run(3.0)
    assert flight.copter.pilot.state == State(Mode.HOLD, armed=True)
    assert hypot(*flight.velocity) < 0.05
    assert flight.position[2] == pytest.approx(1.0, abs=0.2)
    flight.land()
    assert flight.arm() == ACCEPTED


def test_the_battery_is_counted_across_flights() -> None:
    flight = CopterFlight(values={"COM_DISARM_LAND": 0.2})
    for _ in range(2):
        flight.takeoff(0.5)
        flight.land()
    flight.run(0.6)
    consumed_mah = flight.client.latest("BATTERY_STATUS").current_consumed
    assert consumed_mah == pytest.approx(1e3 * flight.world.charge_used_ah, abs=1.0)
    assert consumed_mah > 15
