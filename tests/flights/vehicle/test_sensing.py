"""A vehicle on its sensors, with a rangefinder or without, and one whose commands take effect late."""

from collections.abc import Callable
from math import dist, hypot

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK, latest, restart
from tools.chaos import Thrower

pytestmark = [QUICK, pytest.mark.sitl(params={"COM_DISARM_LAND": 0.1})]

LATENCY_MS = 20.0
TOO_FAST = "lemniscate:lap=3,height=20"
CURVE = position(track(TOO_FAST), np.linspace(0.0, 3.0, 20_000))


def off_m(sitl: Sitl) -> float:
    estimate = sitl.inside.copter.parts.state_source.estimate
    assert estimate is not None
    return dist(estimate.frame.position_enu_m, sitl.position)


@pytest.mark.seed(1)
@pytest.mark.feedback("sensors")
def test_a_flight_on_sensors_from_arming_to_landing(sitl: Sitl) -> None:
    sitl.takeoff(2.0)
    sitl.goto(6.0, 3.0, 3.0, wait=False)
    sitl.run(2.0)
    imu, gps, status = (latest(sitl, name) for name in ("HIGHRES_IMU", "GPS_RAW_INT", "ESTIMATOR_STATUS"))
    assert imu.zacc == pytest.approx(-9.81, abs=1.5)
    assert imu.zacc != -9.81
    assert hypot(imu.xmag, imu.ymag, imu.zmag) == pytest.approx(0.48, abs=0.03)
    assert gps.fix_type == 3
    assert gps.satellites_visible > 3
    assert status.flags & mav.ESTIMATOR_POS_HORIZ_ABS
    assert 0.0 < status.pos_horiz_accuracy < 1.0
    assert 0.0 < status.vel_ratio < 1.0
    sitl.run(5.0)
    assert sitl.position == pytest.approx((6.0, 3.0, 3.0), abs=1.0)
    assert off_m(sitl) < 1.0
    sitl.land()
    assert abs(sitl.position[2]) < 0.01
    assert sitl.inside.copter.pilot.ground.standing


@pytest.mark.feedback("sensors")
@pytest.mark.seed(1)
def test_a_rangefinder_keeps_the_height_through_its_faults(sitl_fleet: Callable[..., list[Sitl]]) -> None:
    with_one, without = (sitl_fleet(1, system=1, vehicle=f"hummingbird{name}")[0] for name in ("-rangefinder", ""))
    for sitl in (with_one, without):
        sitl.takeoff(2.0)
        sitl.goto(0.0, 0.0, 2.0, wait=False)
        sitl.run(6.0)
    assert abs(without.position[2] - 2.0) > 0.2
    sitl = with_one
    assert sitl.position[2] == pytest.approx(2.0, abs=0.03)
    reading, status = latest(sitl, "DISTANCE_SENSOR"), latest(sitl, "SYS_STATUS")
    assert reading.current_distance == pytest.approx(212.0, abs=12.0)
    assert (reading.min_distance, reading.max_distance, reading.signal_quality) == (5, 4000, 100)
    assert status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_LASER_POSITION
    source = sitl.inside.copter.parts.state_source
    for kind, value in (("off", 0.0), ("stuck", 0.0), ("wrong", 1.0)):
        sitl.inject("distance_sensor", kind, 0, value)
        sitl.run(2.0)
        assert source.estimate is not None
        assert source.estimate.health.not_accepted == ("rangefinder",)
        assert sitl.position[2] == pytest.approx(2.0, abs=0.2)
        sitl.inject("distance_sensor", "ok")
        sitl.run(1.0)
        assert not source.estimate.health.not_accepted
    sitl.land(within=30.0)
    assert abs(sitl.position[2]) < 0.01


# Commands that take effect 40 ms late; not compensated the vehicle is lost.


@pytest.mark.sitl(airborne=5.0, latency=LATENCY_MS)
def test_a_delay_is_measured_reported_and_compensated(sitl: Sitl) -> None:
    sitl.run(1.0)
    sitl.goto(3.0, 1.0, 6.0, speed=4.0, wait=False)
    sitl.run(5.0)
    assert dist(sitl.position, (3.0, 1.0, 6.0)) < 0.02
    assert sitl.inside.copter.parts.delay.delay_us == 2e3 * LATENCY_MS
    reported = [it.value for it in sitl.heard("NAMED_VALUE_FLOAT") if it.name == "delay_us"]
    assert reported[-1] == 2e3 * LATENCY_MS


@pytest.mark.sitl(airborne=20.0, latency=LATENCY_MS, params={"SYS_CMD_DELAY": 36.0})
def test_without_compensation_the_delay_is_too_much(sitl: Sitl) -> None:
    sitl.run(1.5)
    assert dist(sitl.position, (0.0, 0.0, 20.0)) < 0.05
    sitl.set_param("SYS_CMD_DELAY", 0.0)
    sitl.goto(2.0, 0.0, 20.0, wait=False)
    sitl.wait_until(lambda: abs(sitl.euler[0]) + abs(sitl.euler[1]) > 1.5, within=6.0)


@pytest.mark.parametrize("feedback", [pytest.param("state", marks=pytest.mark.long), "sensors"])
def test_with_a_delay_it_takes_off_and_lands(sitl_fleet: Callable[..., list[Sitl]], feedback: str) -> None:
    (sitl,) = sitl_fleet(1, feedback=feedback, latency=LATENCY_MS, seed=3)
    sitl.takeoff(1.0)
    sitl.hold(lambda: max(map(abs, sitl.euler[:2])) < 0.1, for_=1.0)
    sitl.land()
    assert abs(sitl.position[2]) < 0.01


@pytest.mark.sitl(airborne=4.0, latency=0.5 * LATENCY_MS)
def test_with_a_delay_a_lost_rotor_is_flown_down(sitl: Sitl) -> None:
    sitl.run(1.0)
    sitl.inject("motor", "off", 1)
    sitl.wait_until(lambda: not sitl.armed, within=20.0)
    assert abs(sitl.position[2]) < 0.1


@pytest.mark.sitl(airborne=5.0, latency=4.0, strict=False)
def test_a_compensation_that_raises_is_left_out(sitl: Sitl) -> None:
    sitl.run(0.2)
    thrower = Thrower("autopilot.control.delay:DelayCompensation.ahead")
    thrower.arm()
    try:
        sitl.run(1.0)
    finally:
        thrower.disarm()
    assert dist(sitl.position, (0.0, 0.0, 5.0)) < 0.05
    assert sitl.said("delay compensation failed: the delay is not compensated")


# Path time: a track waits for a vehicle that cannot follow, and what comes after keeps the time.


def from_curve_m(place: Vector) -> float:
    return float(np.linalg.norm(CURVE - np.array(place), axis=1).min())


ON_PATH = pytest.mark.sitl(profile="path", airborne=20.0, start={"psi": 45.0}, track=TOO_FAST)


@pytest.mark.long
@ON_PATH
def test_a_track_that_is_too_fast_is_flown_on_its_path(sitl: Sitl) -> None:
    pilot = sitl.inside.copter.pilot
    vehicle, reference = [], []
    for _ in range(250):
        sitl.run(0.008)
        vehicle.append(from_curve_m(sitl.position))
        assert pilot.generator.reference is not None
        reference.append(from_curve_m(tuple(pilot.generator.reference.motion[0])))
    assert max(vehicle) < 0.1
    assert max(vehicle[125:]) < 0.03
    assert max(reference) < 0.005
    assert pilot.lag_us == pytest.approx(sitl.inside.copter.parts.loop.lag_us, abs=8_000)
    assert 0.3e6 < pilot.lag_us < 1.5e6


@pytest.mark.long
@ON_PATH
def test_after_path_time_the_reference_keeps_the_speed(sitl: Sitl) -> None:
    sitl.run(1.2)
    pilot, loop = sitl.inside.copter.pilot, sitl.inside.copter.parts.loop
    sitl.select(Mode.HOLD)
    sitl.run(0.1)
    assert pilot.generator.reference is not None
    assert np.linalg.norm(pilot.generator.reference.motion[1]) == pytest.approx(sitl.speed_m_s, rel=0.15)
    assert loop.lag_us == 0
    before_us = pilot.lag_us
    sitl.run(0.5)
    assert pilot.lag_us == before_us


@pytest.mark.long
@ON_PATH
def test_a_restart_goes_on_at_the_same_path_time(sitl: Sitl) -> None:
    sitl.run(1.0)
    lag_us = sitl.inside.copter.pilot.lag_us
    restart(sitl)
    sitl.run(0.02)
    assert sitl.inside.copter.pilot.lag_us == pytest.approx(lag_us, abs=24_000)
