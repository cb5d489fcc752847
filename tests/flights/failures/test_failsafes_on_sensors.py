"""What the vehicle does when it does not know where it is, or which way is up: on sensors, and where the state lies."""

from collections.abc import Callable
from dataclasses import replace
from math import dist, hypot

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.sensors import Frame, SensorFrame, Updated
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import mav
from tools.harness.client import Client
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight, in_the_air

GPS, OFF, OK = (float(number) for number in (mav.FAILURE_UNIT_SENSOR_GPS, mav.FAILURE_TYPE_OFF, mav.FAILURE_TYPE_OK))


def flying(height_m: float, **values: float) -> CopterFlight:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=3, values={"SYS_FAILURE_EN": 1, **values})
    flight.takeoff(height_m)
    return flight


def inject(flight: CopterFlight, unit: float, kind: float) -> None:
    assert flight.command(mav.MAV_CMD_INJECT_FAILURE, unit, kind) == ACCEPTED


def test_a_lost_position_is_left_by_sinking_level_and_disarmed() -> None:
    flight = flying(4.0, COM_POS_FS_EPH=0.6)
    place = flight.position
    inject(flight, GPS, OFF)
    flight.wait_until(lambda: flight.client.said("position lost: descend"), within=30.0)
    assert flight.mode is Mode.LAND
    assert flight.select(Mode.HOLD) == DENIED
    assert flight.client.said("the position is not known")
    lost_s = flight.time_s
    max_rate = 0.0
    while flight.armed:
        flight.run(0.1)
        max_rate = max(max_rate, -flight.velocity[2])
        assert max(map(abs, flight.euler[:2])) < 0.05
    assert flight.time_s - lost_s < 30.0
    assert max_rate < 1.7
    assert dist(flight.position[:2], place[:2]) < 3.0
    assert flight.copter.pilot.ground.standing


def test_without_gps_what_is_set_is_done() -> None:
    flight = flying(3.0, COM_GNSSLOSS_ACT=3)
    inject(flight, GPS, OFF)
    flight.run(2.5)
    assert flight.mode is Mode.LAND
    assert flight.client.said("GPS lost: land")
    inject(flight, GPS, OK)
    flight.run(3.0)
    assert flight.client.said("GPS lost: cleared")


def between(monkeypatch: pytest.MonkeyPatch, flight: CopterFlight, change: Callable[[Frame], Frame]) -> None:
    """Have each frame changed on its way to the autopilot."""
    step = flight.autopilot.step
    monkeypatch.setattr(flight.autopilot, "step", lambda frame, plant_status: step(change(frame), plant_status))


def test_gps_that_says_zero_moves_nobody_to_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = flying(5.0)
    assert flight.goto(8.0, 0.0, 5.0) == ACCEPTED
    flight.run(6.0)

    def nowhere(frame: Frame) -> Frame:
        assert isinstance(frame, SensorFrame)
        return frame if frame.gps is None else frame._replace(gps=replace(frame.gps, place=Geodetic(0.0, 0.0, 0.0)))

    between(monkeypatch, flight, nowhere)
    for _ in range(100):
        flight.run(0.1)
        assert hypot(*flight.position[:2]) > 5.0
    assert flight.client.said("GPS lost: position by dead reckoning")
    assert dist(flight.position, (8.0, 0.0, 5.0)) < 2.0


def test_no_gyroscope_is_no_attitude_and_the_rotors_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = flying(4.0)

    def blind(frame: Frame) -> Frame:
        assert isinstance(frame, SensorFrame)
        return frame._replace(updated=frame.updated & ~Updated.GYROSCOPE)

    between(monkeypatch, flight, blind)
    assert flight.wait_until(lambda: not flight.armed, within=2.0) == pytest.approx(0.52, abs=0.05)
    flight.step()
    assert flight.client.said("attitude lost: rotors stop")
    assert flight.client.latest("HEARTBEAT").system_status == mav.MAV_STATE_FLIGHT_TERMINATION


def test_a_state_that_stays_the_same_though_it_moves_is_not_flown_on(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = in_the_air(10.0)
    assert flight.goto(20.0, 0.0, 10.0) == ACCEPTED
    flight.run(2.0)
    kept: list[StateFrame] = []

    def stuck(frame: Frame) -> Frame:
        assert isinstance(frame, StateFrame)
        kept.append(frame)
        return kept[0]._replace(time_us=frame.time_us)

    between(monkeypatch, flight, stuck)
    assert flight.wait_until(lambda: not flight.armed, within=2.0) == pytest.approx(0.5, abs=0.05)
    flight.step()
    assert flight.client.said("attitude lost: rotors stop")


def test_a_vehicle_at_rest_may_say_the_same_for_ever() -> None:
    flight = in_the_air(5.0)
    flight.run(5.0)
    assert flight.armed
    assert not flight.client.said("lost")


def test_before_anything_is_known_every_command_is_denied_and_why_is_said() -> None:
    client = Client()
    client.send("COMMAND_LONG", 1, 1, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *(0.0,) * 6)
    client.send("SET_MODE", 1, 1, 0)  # not heard yet
    flight = CopterFlight(feedback=Feedback.SENSORS, client=client)
    assert [(ack.command, ack.result) for ack in client.acks] == [(mav.MAV_CMD_COMPONENT_ARM_DISARM, DENIED)]
    assert client.said("not ready: attitude and position are not known yet")
    assert flight.arm() == ACCEPTED
