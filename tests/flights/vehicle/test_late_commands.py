"""A vehicle whose commands take effect 40 ms late, flown by ground stations; not compensated it is lost."""

from math import dist

from colibri.mavlink.hil.faults import MOTOR, OFF
from colibri.mavlink.hil.feedback import Feedback
from tools.chaos.places import Thrower
from tools.harness.copter_flight import ACCEPTED, CopterFlight, in_the_air

LATENCY_US = 20_000


def test_it_is_measured_reported_and_flown_by() -> None:
    flight = in_the_air(latency_us=LATENCY_US)
    flight.run(1.0)
    assert flight.goto(3.0, 1.0, 6.0, speed=4.0) == ACCEPTED
    flight.run(5.0)
    assert dist(flight.position, (3.0, 1.0, 6.0)) < 0.02
    assert flight.copter.parts.delay.delay_us == 2 * LATENCY_US
    reported = [it.value for it in flight.client.heard["NAMED_VALUE_FLOAT"] if it.name == "delay_us"]
    assert reported[-1] == 2.0 * LATENCY_US


def test_a_parameter_tells_it_and_without_compensation_the_vehicle_is_lost() -> None:
    flight = in_the_air(20.0, latency_us=LATENCY_US, values={"SYS_CMD_DELAY": 36.0})
    flight.run(1.5)
    assert dist(flight.position, (0.0, 0.0, 20.0)) < 0.05
    flight.set_param("SYS_CMD_DELAY", 0.0)
    assert flight.goto(2.0, 0.0, 20.0) == ACCEPTED
    flight.wait_until(lambda: abs(flight.euler[0]) + abs(flight.euler[1]) > 1.5, within=6.0)


def test_it_takes_off_and_lands() -> None:
    flight = CopterFlight(latency_us=LATENCY_US)
    flight.takeoff(2.0)
    flight.land()
    assert not flight.armed
    assert abs(flight.position[2]) < 0.01


def test_it_flies_by_its_sensors() -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=3, latency_us=LATENCY_US)
    flight.takeoff(2.0)
    flight.run(1.0)
    assert max(map(abs, flight.euler[:2])) < 0.1


def test_a_lost_rotor_is_noticed_and_flown_down() -> None:
    flight = in_the_air(8.0, latency_us=LATENCY_US // 2)
    flight.run(1.0)
    assert flight.inject(MOTOR, OFF, 1) == ACCEPTED
    flight.wait_until(lambda: not flight.armed, within=20.0)
    assert abs(flight.position[2]) < 0.1


def test_a_compensation_that_raises_is_left_out() -> None:
    flight = in_the_air(latency_us=4_000, strict=False)
    flight.run(0.2)
    thrower = Thrower("autopilot.control.delay:DelayCompensation.ahead")
    thrower.arm()
    try:
        flight.run(2.0)
    finally:
        thrower.disarm()
    assert dist(flight.position, (0.0, 0.0, 5.0)) < 0.05
    assert flight.client.said("delay compensation failed: the delay is not compensated")
