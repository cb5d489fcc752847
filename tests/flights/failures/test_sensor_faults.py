"""Flights without a known position or attitude, and with sensors that are suddenly wrong."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from math import dist, hypot

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.core.step import Step
from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.flights.snapshots import ObjectSnapshot
from colibri.mavlink.hil.plant_status import PlantStatus
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.backends.setting import setting_of
from colibri.sitl.session import Flights
from colibri.sitl.vehicle import Sitl
from tests.support.failed_sensors import Fault, flown_on, matrix, singles
from tests.support.flying import COMPONENT, DENIED, QUICK, SYSTEM, refused
from tools.random_flights import case_of, fly

pytestmark = [QUICK, pytest.mark.sitl(params={"COM_DISARM_LAND": 0.1})]

ON_SENSORS = pytest.mark.sitl(feedback="sensors", seed=3)
OFF, WELL = "accelerometer off: bias reset", "accelerometer accepted again"
Hovering = Callable[[str, float], Sitl]


@pytest.fixture(scope="module")
def hovering() -> Iterator[Hovering]:
    """Return a function that flies in a wind at a height, from the same instant each time."""

    @cache
    def first(wind: str, height_m: float) -> tuple[Sitl, ObjectSnapshot]:
        sitl = begun.begin(wind=wind)
        sitl.takeoff(height_m)
        return sitl, ObjectSnapshot([sitl])

    def restored(wind: str, height_m: float) -> Sitl:
        sitl, snapshot = first(wind, height_m)
        snapshot.restore()
        return sitl

    blind = {"feedback": "sensors", "seed": 2, "strict": False, "params": {"COM_DISARM_LAND": 0.1}}
    with Flights(setting_of([QUICK.kwargs, blind]), None) as begun:
        yield restored


@ON_SENSORS
@pytest.mark.sitl(params={"COM_POS_FS_EPH": 0.6})
def test_without_a_position_it_lands_and_does_not_hold(sitl: Sitl) -> None:
    sitl.takeoff(2.0)
    sitl.inject("gps", "off")
    sitl.wait_until(lambda: sitl.said("Failsafe activated: position lost, descend"), within=30.0)
    assert sitl.mode is Mode.LAND
    refused(sitl, "the position is not known", sitl.select, Mode.HOLD)
    sitl.wait_until(lambda: not sitl.armed, within=30.0)
    assert sitl.inside.copter.pilot.ground.standing
    assert sitl.said("Landing detected, at an unknown speed")


@ON_SENSORS
def test_gps_that_reports_zero_is_not_followed(sitl: Sitl, monkeypatch: pytest.MonkeyPatch) -> None:
    sitl.takeoff(2.0)
    sitl.goto(8.0, 0.0, 2.0, wait=False)
    sitl.run(5.0)
    autopilot = sitl.inside.autopilot
    step: Callable[..., Step] = autopilot.step

    def nowhere(frame: SensorFrame, plant_status: PlantStatus) -> Step:
        gps = frame.gps and replace(frame.gps, place=Geodetic(0.0, 0.0, 0.0))
        return step(frame._replace(gps=gps), plant_status)

    monkeypatch.setattr(autopilot, "step", nowhere)
    sitl.hold(lambda: hypot(*sitl.position[:2]) > 5.0, for_=5.0)
    assert sitl.said("Warning: GPS lost, position by dead reckoning")
    assert dist(sitl.position, (8.0, 0.0, 2.0)) < 2.0


@pytest.mark.sitl(feedback="sensors", ready=False)
def test_before_the_first_estimate_commands_are_denied(sitl: Sitl) -> None:
    sitl.send("COMMAND_LONG", SYSTEM, COMPONENT, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1.0, *(0.0,) * 6)
    sitl.send("SET_MODE", SYSTEM, 1, 0)  # not heard yet
    sitl.wait_until(lambda: sitl.gcs.acks, within=1.0)
    assert [(ack.command, ack.result) for ack in sitl.gcs.acks] == [(mav.MAV_CMD_COMPONENT_ARM_DISARM, DENIED)]
    assert sitl.said("Not ready: no attitude and position estimate yet")
    sitl.run(3.0)
    sitl.arm()


@pytest.mark.long
@pytest.mark.sitl(feedback="sensors", seed=1)
def test_a_sudden_accelerometer_bias_is_estimated(sitl: Sitl) -> None:
    bias = (0.0, 0.0, 2.0)
    sitl.takeoff(5.0)
    source = sitl.inside.copter.parts.state_source
    assert not sitl.said(OFF)
    for kind, numbers, resets in (("wrong", bias, 1), ("ok", (), 2)):
        sitl.inject("accel", kind, 0, *numbers)
        x, y, z = sitl.position
        sitl.hold(lambda: abs(sitl.position[2] - z) < 1.0 and dist(sitl.position[:2], (x, y)) < 1.0, for_=7.0)  # noqa: B023
        assert sitl.texts[-2:] == [OFF, WELL]
        assert source.estimate is not None
        assert source.estimate.resets == resets
        assert resets == 2 or source.estimate.accel_bias_m_s2 == pytest.approx(bias, abs=0.3)
    assert sitl.mode is Mode.HOLD
    assert not sitl.said("lost")


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (Fault("accel", "stuck"), "Failsafe activated: accelerometer lost, land"),
        pytest.param(Fault("accel", "garbage"), "Failsafe activated: accelerometer lost, land", marks=pytest.mark.long),
        (Fault("gyro", "off"), "Failsafe activated: gyroscope lost, land"),
        pytest.param(Fault("gyro", "garbage"), "Failsafe activated: gyroscope lost, land", marks=pytest.mark.long),
        (Fault("gyro", "garbage", (4.0,)), "Failsafe activated: gyroscope lost, land"),
        (Fault("baro", "off"), "Warning: barometer lost"),
    ],
)
def test_without_a_sensor_it_lands_softly(hovering: Hovering, fault: Fault, says: str) -> None:
    outcome = flown_on(hovering("5@270", 3.0), [fault], watched_s=2.0)
    assert not outcome.bad
    assert outcome.disarmed_s is not None
    assert outcome.disarmed_s < 10.0
    assert says in outcome.texts
    assert not any("mpact" in text for text in outcome.texts)


def test_a_landing_without_gyroscope_ends_upright(hovering: Hovering) -> None:
    sitl = hovering("5@270", 3.0)
    sitl.select(Mode.LAND)
    sitl.wait_until(lambda: sitl.position[2] < 0.8, within=10.0)
    sitl.inject("gyro", "delayed", 0, 2.0)
    sitl.wait_until(lambda: sitl.said("Landing detected"), within=3.0)
    sitl.wait_until(lambda: not sitl.armed, within=3.0)
    assert sitl.tilt_deg < 5.0


@pytest.mark.long
@pytest.mark.parametrize("delay_s", [0.1, 0.2, 0.4])
@pytest.mark.sitl(feedback="sensors", vehicle="jmavsim", wind="5@90", seed=1, strict=False)
def test_a_magnetometer_that_comes_late_is_not_followed(sitl: Sitl, delay_s: float) -> None:
    sitl.takeoff(5.0)
    sitl.inject("mag", "delayed", 1, delay_s)
    sitl.run(2.0)
    for place in ((10.0, 5.0, 6.0), (-5.0, -8.0, 8.0), (12.0, -4.0, 5.0)):
        sitl.goto(*place, wait=False)
        sitl.run(5.0)
        assert sitl.tilt_deg < 50.0
    assert sitl.said("magnetometer lost")
    sitl.select(Mode.LAND)
    sitl.wait_until(lambda: not sitl.armed, within=30.0)
    assert sitl.tilt_deg < 10.0
    assert not sitl.said("Impact")


@pytest.mark.long
@ON_SENSORS
@pytest.mark.parametrize(("drift", "gps_first"), [(17.0, True), (17.0, False), (-17.0, False), (5.0, False)])
def test_a_barometer_that_drifts_does_not_keep_a_vehicle_without_gps_in_the_air(
    sitl: Sitl, drift: float, gps_first: bool
) -> None:
    sitl.takeoff(4.0)
    if gps_first:
        sitl.inject("gps", "off")
        sitl.run(3.0)
    sitl.inject("baro", "slow", 0, drift)
    sitl.run(12.0)
    sitl.inject("gps", "off")
    sitl.wait_until(lambda: not sitl.armed, within=120.0)
    assert sitl.path[:, 2].max() < 30.0
    assert not sitl.said("Impact")


@ON_SENSORS
@pytest.mark.parametrize(
    ("unit", "why"), [("gyro", "gyroscope lost"), ("accel", "inertial sensors failed")], ids=["gyro", "accel"]
)
@pytest.mark.sitl(params={"COM_DISARM_LAND": 5.0})
def test_without_an_inertial_sensor_a_landed_vehicle_stays_down(sitl: Sitl, unit: str, why: str) -> None:
    sitl.takeoff(2.0)
    sitl.inject(unit, "off")
    sitl.run(1.0)
    if unit == "gyro":
        refused(sitl, f"hold refused: {why}", sitl.select, Mode.HOLD)
    sitl.wait_until(lambda: sitl.said("Landing detected"), within=20.0)
    refused(sitl, f"hold refused: {why}", sitl.select, Mode.HOLD)
    refused(sitl, f"track refused: {why}", sitl.fly_track, "circle")
    sitl.wait_until(lambda: not sitl.armed, within=10.0)
    assert not sitl.said("Impact")


@pytest.mark.parametrize(("kind", "late_s"), [("stuck", 0.0), pytest.param("delayed", 0.03, marks=pytest.mark.long)])
def test_a_gyroscope_that_fails_in_a_turn_is_not_flown_against(hovering: Hovering, kind: str, late_s: float) -> None:
    sitl = hovering("7@188", 5.0)
    sitl.goto(40.0, 0.0, 5.0, wait=False)
    sitl.run(3.0)
    sitl.goto(-40.0, 0.0, 5.0, wait=False)
    sitl.run(0.15)
    sitl.inject("gyro", kind, 0, late_s)
    sitl.hold(lambda: sitl.tilt_deg < 50.0, for_=2.0)
    sitl.wait_until(lambda: sitl.said("Disarmed by landing"), within=20.0)


def test_with_a_large_gyroscope_bias_it_flies_on(hovering: Hovering) -> None:
    sitl = hovering("7@188", 5.0)
    sitl.inject("gyro", "wrong", 0, -2.0, 1.0, 0.0)
    sitl.hold(lambda: sitl.tilt_deg < 30.0, for_=2.0)
    assert sitl.mode is Mode.HOLD


@pytest.mark.sitl(feedback="sensors", vehicle="iris", wind="9@39", strict=False)
def test_feet_on_the_ground_end_a_landing(sitl: Sitl) -> None:
    sitl.takeoff(2.0)
    sitl.inject("accel", "off")
    sitl.wait_until(lambda: sitl.position[2] < 0.03, within=10.0)
    sitl.wait_until(lambda: sitl.said("Landing detected"), within=0.5)
    sitl.hold(lambda: sitl.tilt_deg < 25.0, for_=1.0)


@pytest.mark.long
@pytest.mark.parametrize("seed", [133, 351, 376, 418])
def test_slow_drifts_and_winds_end_in_landings(seed: int) -> None:
    assert not fly(case_of(seed)).violated


@pytest.mark.long
@pytest.mark.parametrize(
    ("unit", "drift"),
    [("mag", (0.03, 0.0, 0.0)), ("gyro", (0.003, 0.0, 0.0))],
    ids=["magnetometer", "gyroscope"],
)
@pytest.mark.sitl(feedback="sensors", vehicle="jmavsim", wind="7@200", strict=False)
def test_a_sensor_that_drifts_slowly_turns_nothing(sitl: Sitl, unit: str, drift: Vector) -> None:
    sitl.takeoff(3.0)
    sitl.inject(unit, "slow", 0, *drift)
    for place in range(4):
        sitl.goto(12.0 if place % 2 else -12.0, 6.0 * (place % 3), 3.0, wait=False)
        sitl.run(4.0)
    sitl.select(Mode.LAND)
    sitl.wait_until(lambda: not sitl.armed, within=30.0)
    assert sitl.said("Landing detected")
    assert not any(word in text for text in sitl.texts for word in ("mpact", "attitude", "tilted"))


@pytest.mark.long
def test_no_slow_drift_ends_in_an_impact() -> None:
    drifts = [(unit, drift, axis) for unit, drift in (("mag", 0.01), ("accel", 0.1)) for axis in range(3)]
    cases = [[Fault(unit, "slow", (0.0,) * axis + (-drift,) + (0.0,) * (2 - axis))] for unit, drift, axis in drifts]
    assert not [name for name, outcome in matrix(cases, [5.0], ["cruise"], seed=3, vehicle="iris") if outcome.bad]


@pytest.mark.long
def test_no_failed_sensor_ends_in_an_impact() -> None:
    assert not [name for name, outcome in matrix(singles()) if outcome.bad]
