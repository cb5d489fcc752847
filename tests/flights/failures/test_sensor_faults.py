"""What the vehicle does when it does not know where it is, or which way is up; and when a sensor is suddenly wrong."""

from collections.abc import Callable
from dataclasses import replace
from math import dist, hypot
from typing import Any

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.core.step import Step
from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.hil.sensors import Frame, SensorFrame, Updated
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.vehicle import Sitl
from tests.support.flying import COMPONENT, DENIED, QUICK, SYSTEM, refused

pytestmark = QUICK

ON_SENSORS = pytest.mark.sitl(feedback="sensors", seed=3)
OFF, WELL = "accelerometer off: bias reset", "accelerometer accepted again"
TURNS = "gyroscope off: bias reset"


def between(monkeypatch: pytest.MonkeyPatch, sitl: Sitl, change: Callable[[Any], Frame]) -> None:
    """Have each frame changed on its way to the autopilot."""
    autopilot = sitl.inside.autopilot
    step: Callable[..., Step] = autopilot.step

    def changed(frame: Any, plant_status: PlantStatus) -> Step:
        return step(change(frame), plant_status)

    monkeypatch.setattr(autopilot, "step", changed)


def stays(sitl: Sitl, seconds: float, max_m: float = 1.0) -> None:
    x, y, z = sitl.position
    sitl.hold(lambda: abs(sitl.position[2] - z) < max_m and dist(sitl.position[:2], (x, y)) < max_m, for_=seconds)


@ON_SENSORS
@pytest.mark.sitl(params={"COM_POS_FS_EPH": 0.6})
def test_a_lost_position_is_left_by_sinking_level(sitl: Sitl) -> None:
    sitl.takeoff(4.0)
    place = sitl.position
    sitl.inject("gps", "off")
    sitl.wait_until(lambda: sitl.said("position lost: descend"), within=30.0)
    assert sitl.mode is Mode.LAND
    refused(sitl, "the position is not known", sitl.select, Mode.HOLD)

    def slow_and_level() -> bool:
        return sitl.velocity[2] > -1.7 and max(map(abs, sitl.euler[:2])) < 0.05

    sitl.wait_until(lambda: not (sitl.armed and slow_and_level()), within=30.0)
    assert not sitl.armed
    assert dist(sitl.position[:2], place[:2]) < 3.0
    assert sitl.inside.copter.pilot.ground.standing


@ON_SENSORS
@pytest.mark.sitl(params={"COM_GNSSLOSS_ACT": 3})
def test_without_gps_what_is_set_is_done(sitl: Sitl) -> None:
    sitl.takeoff(3.0)
    sitl.inject("gps", "off")
    sitl.run(2.5)
    assert sitl.mode is Mode.LAND
    assert sitl.said("GPS lost: land")
    sitl.inject("gps", "ok")
    sitl.run(3.0)
    assert sitl.said("GPS lost: cleared")


@ON_SENSORS
def test_gps_that_reports_zero_is_not_followed(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    sitl.takeoff(5.0)
    sitl.goto(8.0, 0.0, 5.0, wait=False)
    sitl.run(6.0)

    def nowhere(frame: SensorFrame) -> SensorFrame:
        return frame if frame.gps is None else frame._replace(gps=replace(frame.gps, place=Geodetic(0.0, 0.0, 0.0)))

    between(monkeypatch, sitl, nowhere)
    sitl.hold(lambda: hypot(*sitl.position[:2]) > 5.0, for_=10.0)
    assert sitl.said("GPS lost: position by dead reckoning")
    assert dist(sitl.position, (8.0, 0.0, 5.0)) < 2.0


@ON_SENSORS
def test_without_a_gyroscope_the_rotors_stop(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    sitl.takeoff(4.0)

    def blind(frame: SensorFrame) -> SensorFrame:
        return frame._replace(updated=frame.updated & ~Updated.GYROSCOPE)

    between(monkeypatch, sitl, blind)
    assert sitl.wait_until(lambda: not sitl.armed, within=2.0) == pytest.approx(0.52, abs=0.05)
    sitl.step()
    assert sitl.said("attitude lost: rotors stop")
    assert sitl.gcs.latest("HEARTBEAT").system_status == mav.MAV_STATE_FLIGHT_TERMINATION


@pytest.mark.sitl(airborne=10.0)
def test_a_moving_state_that_never_changes_is_not_flown(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    sitl.hold(lambda: sitl.armed and not sitl.said("lost"), for_=3.0)  # at rest it may stay the same for ever
    sitl.goto(20.0, 0.0, 10.0, wait=False)
    sitl.run(2.0)
    kept: list[StateFrame] = []

    def stuck(frame: StateFrame) -> StateFrame:
        kept.append(frame)
        return kept[0]._replace(time_us=frame.time_us)

    between(monkeypatch, sitl, stuck)
    assert sitl.wait_until(lambda: not sitl.armed, within=2.0) == pytest.approx(0.5, abs=0.05)
    sitl.step()
    assert sitl.said("attitude lost: rotors stop")


@pytest.mark.sitl(feedback="sensors", ready=False)
def test_before_the_first_estimate_commands_are_denied(sitl: Sitl) -> None:
    sitl.send("COMMAND_LONG", SYSTEM, COMPONENT, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *(0.0,) * 6)
    sitl.send("SET_MODE", SYSTEM, 1, 0)  # not heard yet
    sitl.wait_until(lambda: sitl.gcs.acks, within=1.0)
    assert [(ack.command, ack.result) for ack in sitl.gcs.acks] == [(mav.MAV_CMD_COMPONENT_ARM_DISARM, DENIED)]
    assert sitl.said("not ready: attitude and position are not known yet")
    sitl.run(3.0)
    sitl.arm()


@ON_SENSORS
def test_a_gps_jump_and_a_gyroscope_error_are_survived(sitl: Sitl) -> None:
    sitl.takeoff(5.0)
    before = sitl.position
    sitl.inject("gps", "wrong", 0, 200.0, 0.0, 0.0)
    sitl.run(5.0)
    assert dist(sitl.position, before) < 5.0
    sitl.inject("gps", "ok")
    sitl.inject("gyro", "wrong", 0, 0.02, 0.0, 0.0)
    sitl.run(5.0)
    assert max(map(abs, sitl.euler[:2])) < 0.2
    sitl.inject("gyro", "ok")
    sitl.inject("baro", "stuck")
    sitl.run(5.0)
    assert sitl.position[2] == pytest.approx(5.0, abs=2.0)


@pytest.mark.parametrize(
    ("bias", "seed"), [((0.0, 0.0, 2.0), 1), pytest.param((1.0, 0.0, 0.0), 3, marks=pytest.mark.long)]
)
def test_a_sudden_accelerometer_bias_is_estimated(
    sitl_fleet: Callable[..., list[Sitl]], bias: Vector, seed: int
) -> None:
    (sitl,) = sitl_fleet(1, feedback="sensors", seed=seed)
    sitl.takeoff(10.0)
    sitl.run(2.0)
    source = sitl.inside.copter.parts.state_source
    assert not sitl.said(OFF)
    for kind, numbers, resets in (("wrong", bias, 1), ("ok", (), 2)):
        sitl.inject("accel", kind, 0, *numbers)
        stays(sitl, 7.0)
        assert sitl.texts[-2:] == [OFF, WELL]
        assert source.estimate is not None
        assert source.estimate.resets == resets
        assert resets == 2 or source.estimate.accel_bias_m_s2 == pytest.approx(bias, abs=0.3)
    assert sitl.mode is Mode.HOLD
    assert not sitl.said("lost")


@pytest.mark.long
@pytest.mark.parametrize("bias", [(0.02, 0.0, 0.0), (0.0, -0.1, 0.0), (0.2, 0.2, 0.1)])
@ON_SENSORS
def test_a_sudden_gyroscope_bias_is_estimated(sitl: Sitl, bias: Vector) -> None:
    sitl.takeoff(10.0)
    sitl.run(2.0)
    source = sitl.inside.copter.parts.state_source
    assert not sitl.said(TURNS)
    assert source.estimate is not None
    own = source.estimate.gyro_bias_rad_s
    for kind, numbers in (("wrong", bias), ("ok", (0.0, 0.0, 0.0))):
        sitl.inject("gyro", kind, 0, *numbers)
        stays(sitl, 9.0)
        expected = [a + b for a, b in zip(own, numbers, strict=True)]
        assert source.estimate.gyro_bias_rad_s == pytest.approx(expected, abs=2e-3)
    assert sitl.said(TURNS)
    assert sitl.mode is Mode.HOLD
    assert not sitl.said("lost")


@pytest.mark.long
@ON_SENSORS
def test_a_gyroscope_that_drifts_is_followed(sitl: Sitl) -> None:
    sitl.takeoff(10.0)
    sitl.inject("gyro", "slow", 0, 0.01)
    stays(sitl, 20.0)
    assert sitl.said(TURNS)
    assert not sitl.said("lost")
