"""Flights with faults, injected as a ground station does or by nobody; and flights of an autopilot that is slow."""

from math import dist, hypot, nan

import pytest

from colibri.mavlink.hil.faults import BAROMETER, BATTERY, GPS, GYROSCOPE, MOTOR, OFF, OK, STUCK, WRONG
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import load_vehicle
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight, in_the_air

INJECT = mav.MAV_CMD_INJECT_FAILURE


def test_a_ground_station_weakens_a_rotor_and_the_vehicle_stays() -> None:
    flight = in_the_air()
    assert flight.command(INJECT, MOTOR, WRONG, 1.0, 0.65) == DENIED
    assert flight.client.said("SYS_FAILURE_EN is 0")
    flight.set_param("SYS_FAILURE_EN", 1)
    assert flight.command(INJECT, GPS, OFF) == mav.MAV_RESULT_UNSUPPORTED
    assert flight.client.said("flown by the state")
    assert flight.command(INJECT, MOTOR, WRONG, 1.0, 65.0) == DENIED
    assert flight.client.said("part that is left must be 0.001 to 1")
    assert flight.command(INJECT, MOTOR, WRONG, 1.0, 0.65, nan, nan, nan) == ACCEPTED
    assert len(flight.client.acks) == 4
    path = flight.path(8.0)
    assert 0.005 < max(dist(place, (0.0, 0.0, 5.0)) for place in path) < 0.5
    weak, other = flight.rotors.controls[0], flight.rotors.controls[2]
    assert weak / other == pytest.approx(0.65**-0.5, rel=0.02)
    assert flight.command(INJECT, MOTOR, OK) == ACCEPTED
    flight.run(4.0)
    assert flight.rotors.controls[0] == pytest.approx(flight.rotors.controls[2], rel=0.01)


def test_a_battery_that_sags_is_known_to_the_autopilot() -> None:
    flight = in_the_air()
    flight.run(1.0)
    before = flight.client.latest("BATTERY_STATUS")
    assert before.battery_remaining >= 99
    assert flight.inject(BATTERY, WRONG, 0, 0.3) == ACCEPTED
    flight.run(2.5)
    after = flight.client.latest("BATTERY_STATUS")
    assert after.battery_remaining == pytest.approx(30, abs=1)
    capacity_ah = load_vehicle("hummingbird").battery.capacity_ah  # type: ignore[union-attr]
    assert flight.copter.parts.battery.charge_ah == pytest.approx(0.7 * capacity_ah, rel=0.03)
    real_v = flight.world.voltage_v
    told_v = sum(cell for cell in after.voltages if cell != 65535) / 1e3
    assert told_v == pytest.approx(real_v, rel=0.03)
    assert flight.position == pytest.approx((0.0, 0.0, 5.0), abs=0.1)
    flight.restart()
    flight.run(0.2)
    assert flight.copter.parts.battery.charge_ah == pytest.approx(0.7 * capacity_ah, rel=0.03)


def test_a_gps_that_jumps_and_a_gyroscope_that_errs_are_survived() -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=3)
    flight.takeoff(5.0)
    before = flight.position
    assert flight.inject(GPS, WRONG, 0, 200.0, 0.0, 0.0) == ACCEPTED
    flight.run(5.0)
    assert dist(flight.position, before) < 5.0
    assert flight.inject(GPS, OK) == ACCEPTED
    assert flight.inject(GYROSCOPE, WRONG, 0, 0.02, 0.0, 0.0) == ACCEPTED
    flight.run(5.0)
    assert max(map(abs, flight.euler[:2])) < 0.2
    assert flight.inject(GYROSCOPE, OK) == ACCEPTED
    assert flight.inject(BAROMETER, STUCK) == ACCEPTED
    flight.run(5.0)
    assert flight.position[2] == pytest.approx(5.0, abs=2.0)


def flown(solve_ms: float) -> tuple[list[tuple[float, ...]], CopterFlight]:
    """Hold, go 2 m east, hold."""
    flight = in_the_air(values={"SIM_SOLVE_MS": solve_ms})
    flight.run(0.5)
    assert flight.goto(2.0, 0.0, 5.0) == ACCEPTED
    return [tuple(place) for place in flight.path(6.0)], flight


def test_a_slow_solver_acts_late_and_skips_what_falls_due() -> None:
    at_once, prompt = flown(0.0)
    within, in_time = flown(8.0)
    over, late = flown(12.0)
    assert prompt.copter.parts.actuation.missed == in_time.copter.parts.actuation.missed == 0
    assert late.copter.parts.actuation.missed == pytest.approx(6.5 / 0.016, rel=0.05)  # every second sample is skipped
    assert within != at_once
    assert over != within
    for path in (at_once, within, over):
        x, y, z = path[-1]
        assert hypot(x - 2.0, y, z - 5.0) < 0.1
    assert flown(12.0)[0] == over


def test_a_late_command_is_a_flight_of_its_own_the_same_each_time() -> None:
    def path(latency_us: int) -> list[tuple[float, ...]]:
        flight = in_the_air(latency_us=latency_us)
        return [tuple(place) for place in flight.path(1.5)]

    prompt, late = path(0), path(5_000)
    assert late == path(5_000)
    assert late != prompt
    assert dist(late[-1], prompt[-1]) < 0.05
