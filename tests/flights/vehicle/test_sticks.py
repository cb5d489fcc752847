"""A pilot's sticks, over MAVLink: place, height, tilt, and what happens once they fall silent."""

from math import cos, degrees, hypot, radians, sin

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight


def flying(mode: Mode, height_m: float = 5.0) -> CopterFlight:
    """Take off and go over to the sticks, which are in the middle."""
    flight = CopterFlight()
    flight.takeoff(height_m)
    flight.stick()
    flight.step()
    assert flight.select(mode) == ACCEPTED
    return flight


def hold_sticks(flight: CopterFlight, seconds: float, **deflection: float) -> None:
    """Keep the sticks where they are; they are sent at 20 Hz."""
    for _ in range(round(seconds * 20)):
        flight.stick(**deflection)
        flight.run(0.05)


@pytest.mark.parametrize("mode", [Mode.POSITION, Mode.ALTITUDE, Mode.STABILIZED])
def test_without_sticks_there_is_no_such_mode_in_flight(mode: Mode) -> None:
    flight = CopterFlight()
    flight.takeoff()
    assert flight.select(mode) == DENIED
    assert flight.client.said("no MANUAL_CONTROL is heard")


@pytest.mark.parametrize(
    "mode", [Mode.STABILIZED, *(pytest.param(mode, marks=pytest.mark.long) for mode in (Mode.POSITION, Mode.ALTITUDE))]
)
def test_silent_sticks_lead_to_hold(mode: Mode) -> None:
    flight = flying(mode)
    hold_sticks(flight, 0.5)
    assert flight.mode is mode
    silent_s = 0.05 + flight.wait_until(lambda: flight.mode is Mode.HOLD, within=1.0, what="hold")
    assert silent_s == pytest.approx(0.5, abs=0.01)
    assert flight.client.said("sticks lost")
    flight.run(4.0)
    assert hypot(*flight.velocity) < 0.02


def test_position_sticks_are_a_velocity_along_the_heading_and_let_go_hold_the_place() -> None:
    flight = flying(Mode.POSITION)
    hold_sticks(flight, 4.0, pitch=0.525)  # half of what is beyond the play
    east, north, _ = flight.velocity
    assert east * cos(flight.yaw_rad) + north * sin(flight.yaw_rad) == pytest.approx(2.5, abs=0.1)
    assert hypot(east, north) == pytest.approx(2.5, abs=0.1)
    hold_sticks(flight, 3.0)
    place = flight.position
    hold_sticks(flight, 2.0)
    assert flight.position == pytest.approx(place, abs=0.02)


def test_position_sticks_climb_and_turn() -> None:
    flight = flying(Mode.POSITION)
    yaw = flight.yaw_rad
    hold_sticks(flight, 1.5, thrust=1.0, yaw=1.0)
    assert flight.velocity[2] == pytest.approx(3.0, abs=0.3)
    assert degrees(flight.yaw_rad - yaw) < -60.0  # clockwise
    hold_sticks(flight, 3.0)
    height = flight.position[2]
    hold_sticks(flight, 1.0)
    assert flight.position[2] == pytest.approx(height, abs=0.02)


def test_altitude_sticks_lean_and_keep_the_height() -> None:
    flight = flying(Mode.ALTITUDE, 10.0)
    height = flight.position[2]
    flight.set_param("MPC_MAN_TILT_MAX", 20.0)
    hold_sticks(flight, 3.0, roll=1.0)
    assert degrees(flight.euler[0]) == pytest.approx(20.0, abs=1.5)
    assert flight.position[2] == pytest.approx(height, abs=0.3)
    hold_sticks(flight, 2.0, thrust=0.75)
    assert flight.velocity[2] > 1.0


def test_stabilized_sticks_are_tilt_yaw_rate_and_thrust() -> None:
    flight = flying(Mode.STABILIZED, 10.0)
    hold_sticks(flight, 1.0, pitch=0.5)
    assert degrees(flight.euler[1]) == pytest.approx(17.5, abs=1.0)  # of 35 degrees
    flight.set_param("MPC_MAN_TILT_MAX", 20.0)
    hold_sticks(flight, 1.0, pitch=0.5)
    assert degrees(flight.euler[1]) == pytest.approx(10.0, abs=1.0)
    yaw = flight.yaw_rad
    flight.set_param("MPC_MAN_Y_MAX", 60.0)
    hold_sticks(flight, 2.0, yaw=-1.0)
    assert flight.yaw_rad - yaw == pytest.approx(radians(60.0) * 2.0, abs=0.4)
    climb = flight.velocity[2]
    hold_sticks(flight, 1.0, thrust=0.8)
    assert flight.velocity[2] > climb + 1.0


def test_position_sticks_land_and_take_off() -> None:
    flight = flying(Mode.POSITION, 1.5)
    hold_sticks(flight, 6.0, thrust=0.0)
    assert flight.copter.pilot.ground.standing
    hold_sticks(flight, 2.5, thrust=0.0)
    assert not flight.armed
