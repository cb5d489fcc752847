"""What the vehicle does when something is lost: each row of the failsafes' table, flown."""

from collections.abc import Callable
from math import hypot

import pytest
from msgspec.structs import replace

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.common.types import Vector
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK, in_mode, latest, refused, restart, stream

pytestmark = QUICK

RETURN, LAND = 2, 3
EASTWARD: Vector = (1.0, 0.0, 0.0)
ON_STATION_LOSS = pytest.mark.sitl(airborne=10.0, params={"NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 2.0})


def reported_state(sitl: Sitl) -> int:
    sitl.run(0.1)
    return int(sitl.gcs.latest("HEARTBEAT").system_status)


def charge_state(sitl: Sitl) -> int:
    return int(latest(sitl, "BATTERY_STATUS").charge_state)


def go_offboard(sitl: Sitl, velocity: Vector) -> None:
    sitl.setpoint(velocity=velocity)
    sitl.step()
    sitl.select(Mode.OFFBOARD)


def drain(sitl: Sitl, part: float) -> None:
    sitl.inject("battery", "wrong", 0, 1.0 - part)


# Links.


@ON_STATION_LOSS
def test_a_lost_ground_station_leads_home_and_clears(sitl: Sitl) -> None:
    sitl.set_param("COM_DL_LOSS_T", 4.0)
    sitl.run(1.0)
    heard_s = sitl.time_s // 1.0  # HEARTBEATs are sent at whole seconds
    sitl.gcs.silent = True
    sitl.run(3.0)  # half as long again as the old time
    assert sitl.mode is Mode.HOLD
    assert not sitl.said("lost")
    sitl.wait_until(lambda: sitl.mode is Mode.RETURN, within=2.0)
    assert sitl.time_s - heard_s == pytest.approx(4.0, abs=0.05)
    assert reported_state(sitl) == mav.MAV_STATE_CRITICAL
    assert sitl.said("ground station lost: return")
    sitl.gcs.silent = False
    sitl.run(3.0)
    assert sitl.said("ground station lost: cleared")
    assert in_mode(sitl, Mode.RETURN)
    sitl.select(Mode.HOLD)
    assert reported_state(sitl) == mav.MAV_STATE_ACTIVE


@ON_STATION_LOSS
def test_any_ground_station_will_do(sitl: Sitl) -> None:
    other = sitl.client(250)
    sitl.run(0.5)
    sitl.gcs.silent = True
    sitl.run(3.0)
    assert sitl.mode is Mode.HOLD
    other.silent = True
    sitl.run(2.1)
    assert in_mode(sitl, Mode.RETURN)


@pytest.mark.sitl(airborne=5.0, params={"NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 1.0}, ready=False)
def test_a_station_never_heard_is_not_lost(sitl: Sitl) -> None:
    sitl.gcs.silent = True
    sitl.run(2.0)
    assert sitl.mode is Mode.HOLD


def test_sticks_lost_before_takeoff_stop_the_rotors(sitl: Sitl) -> None:
    sitl.select(Mode.POSITION)
    with sitl.sticks_held(thrust=0.0):
        sitl.run(0.02)
        sitl.arm()
    assert sitl.wait_until(lambda: not sitl.armed, within=1.0) == pytest.approx(0.5, abs=0.05)
    assert reported_state(sitl) != mav.MAV_STATE_FLIGHT_TERMINATION
    assert sitl.said("sticks lost: rotors stop")


@pytest.mark.parametrize(("choice", "mode"), [(3, Mode.RETURN), (4, Mode.LAND), (5, Mode.HOLD)])
@pytest.mark.sitl(airborne=10.0, params={"COM_OF_LOSS_T": 0.8})
def test_lost_setpoints_lead_to_what_is_set(sitl: Sitl, choice: int, mode: Mode) -> None:
    sitl.set_param("COM_OBL_RC_ACT", choice)
    go_offboard(sitl, EASTWARD)
    sitl.setpoint(velocity=EASTWARD)
    silent_s = sitl.wait_until(lambda: sitl.mode is mode, within=1.0)
    assert silent_s == pytest.approx(0.8, abs=0.02)
    stream(sitl, 1.5, lambda: sitl.setpoint(velocity=EASTWARD))
    assert sitl.mode is mode
    assert sitl.said("setpoints lost: cleared")


@pytest.mark.parametrize(
    ("choice", "mode", "state"),
    [(RETURN, Mode.RETURN, mav.MAV_STATE_CRITICAL), (LAND, Mode.LAND, mav.MAV_STATE_EMERGENCY)],
)
@pytest.mark.sitl(airborne=10.0)
def test_lost_sticks_lead_to_what_is_set(sitl: Sitl, choice: int, mode: Mode, state: int) -> None:
    sitl.set_param("NAV_RCL_ACT", choice)
    with sitl.sticks_held():
        sitl.run(0.05)
        sitl.select(Mode.POSITION)
    sitl.run(1.0)
    assert sitl.mode is mode
    assert reported_state(sitl) == state


# Battery.


@pytest.mark.sitl(airborne=5.0, params={"COM_LOW_BAT_ACT": 1, "NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 3.0})
def test_a_low_battery_leads_home_a_critical_one_down(sitl: Sitl) -> None:
    assert charge_state(sitl) == mav.MAV_BATTERY_CHARGE_STATE_OK
    drain(sitl, 0.87)
    sitl.wait_until(lambda: sitl.mode is Mode.RETURN, within=2.0)
    assert charge_state(sitl) == mav.MAV_BATTERY_CHARGE_STATE_LOW
    drain(sitl, 0.94)
    sitl.wait_until(lambda: sitl.mode is Mode.LAND, within=2.0)
    assert charge_state(sitl) == mav.MAV_BATTERY_CHARGE_STATE_CRITICAL
    sitl.gcs.silent = True
    sitl.wait_until(lambda: sitl.said("ground station lost: land goes on"), within=3.1)
    sitl.wait_until(lambda: not sitl.armed, within=15.0)
    sitl.gcs.silent = False
    refused(sitl, "battery critical", sitl.arm)


@pytest.mark.sitl(airborne=5.0, params={"COM_LOW_BAT_ACT": 1, "BAT_LOW_T": 0.5})
def test_a_low_voltage_counts_as_a_low_charge(sitl: Sitl) -> None:
    voltage_v = sitl.inside.world.voltage_v
    sitl.set_param("BAT_LOW_VOLT", voltage_v + 0.5)
    sitl.run(0.6)
    assert sitl.mode is Mode.RETURN
    assert charge_state(sitl) == mav.MAV_BATTERY_CHARGE_STATE_LOW
    sitl.set_param("BAT_CRIT_VOLT", voltage_v + 0.5)
    sitl.run(0.6)
    assert in_mode(sitl, Mode.LAND)
    assert charge_state(sitl) == mav.MAV_BATTERY_CHARGE_STATE_CRITICAL
    assert sitl.said("battery critical: land")


@pytest.mark.sitl(airborne=3.0)
def test_by_default_an_empty_battery_is_only_reported(sitl: Sitl) -> None:
    drain(sitl, 0.97)
    sitl.run(3.0)
    assert sitl.mode is Mode.HOLD
    assert sitl.said("battery nearly empty")


# Fence.


@pytest.mark.sitl(airborne=5.0, params={"GF_MARGIN": 3.0, "GF_PREDICT": 1})
def test_sticks_do_not_push_it_through_the_fence(sitl: Sitl) -> None:
    """At a radius of 15 m and a margin of 3 m it stays at 12 m, within 1 m."""
    sitl.upload_fence(items.circle(15.0))
    with sitl.sticks_held(pitch=1.0):
        sitl.run(0.05)
        sitl.select(Mode.POSITION)
        sitl.hold(lambda: hypot(*sitl.position[:2]) < 13.0, for_=7.0)
        sitl.hold(lambda: 11.0 < hypot(*sitl.position[:2]) < 13.0, for_=3.0)
    assert sitl.said("geofence breached: hold")
    refused(sitl, "outside the geofence", sitl.goto, 14.0, 9.0, 5.0)
    sitl.goto(0.0, 0.0, 5.0, wait=False)
    sitl.run(4.0)
    assert hypot(*sitl.position[:2]) < 8.0
    assert sitl.said("geofence breached: cleared")


@pytest.mark.parametrize(
    ("name", "limit_m", "velocity"),
    [("GF_MAX_HOR_DIST", 4.0, (2.0, 0.0, 0.0)), ("GF_MAX_VER_DIST", 6.0, (0.0, 0.0, 2.0))],
)
@pytest.mark.sitl(airborne=5.0, params={"GF_ACTION": 3, "RTL_RETURN_ALT": 5.0})
def test_a_breach_of_the_home_fence_leads_home(sitl: Sitl, name: str, limit_m: float, velocity: Vector) -> None:
    sitl.set_param(name, limit_m)
    go_offboard(sitl, velocity)
    sitl.wait_until(lambda: sitl.setpoint(velocity=velocity) or sitl.mode is Mode.RETURN, within=8.0)  # type: ignore[func-returns-value]
    refused(sitl, "home", sitl.goto, 5.0, 0.0, 7.0)
    sitl.wait_until(lambda: hypot(*sitl.position[:2]) < 0.5 and sitl.position[2] < 5.0, within=30.0)
    sitl.run(1.2)
    assert sitl.said("geofence breached: cleared")


# Attitude, frames, rotors, law.


@pytest.mark.parametrize(("breaker", "armed"), [(121212, True), (0, False)])
@pytest.mark.sitl(airborne=20.0, params={"FD_FAIL_R": 30.0, "FD_FAIL_P": 30.0})
def test_excessive_tilt_ends_the_flight_only_where_allowed(sitl: Sitl, breaker: int, armed: bool) -> None:
    sitl.set_param("CBRK_FLIGHTTERM", breaker)
    with sitl.sticks_held(roll=1.0):
        sitl.run(0.05)
        sitl.select(Mode.STABILIZED)
        sitl.run(1.2)
    assert sitl.armed is armed
    assert sitl.said("tilted too far" if armed else "tilted too far: rotors stop")
    assert armed or reported_state(sitl) == mav.MAV_STATE_FLIGHT_TERMINATION


@pytest.mark.sitl(airborne=5.0, params={"COM_TEL_LOSS_ACT": 1, "COM_TEL_LOSS_T": 0.1})
def test_missed_frames_lead_to_what_is_set(sitl: Sitl) -> None:
    sitl.inside.skip(5)
    sitl.run(1.0)
    assert not sitl.said("telemetry missed")
    assert sitl.position == pytest.approx((0.0, 0.0, 5.0), abs=0.2)
    sitl.select(Mode.RETURN)
    sitl.run(0.5)
    sitl.inside.skip(25)
    sitl.run(0.1)
    assert sitl.said("telemetry missed: return goes on")
    sitl.select(Mode.HOLD)
    sitl.run(1.2)
    assert sitl.said("telemetry missed: cleared")


def test_a_control_law_that_finds_no_plan_stops(sitl_fleet: Callable[..., list[Sitl]]) -> None:
    flight = load_profile("flight")
    law = flight.table("lpv-mpc")
    hopeless = {**flight.controllers, "lpv-mpc": {**law, "qp": {**law["qp"], "max_iterations": 1}}}
    (sitl,) = sitl_fleet(1, airborne=20.0, profile=replace(flight, controller="lpv-mpc", controllers=hopeless))
    sitl.select(Mode.TRACK)
    assert sitl.wait_until(lambda: sitl.mode is Mode.HOLD, within=1.0) == pytest.approx(0.5, abs=0.05)
    sitl.step()
    assert sitl.said("control law finds no plan: hold")


@pytest.mark.sitl(airborne=8.0, params={"COM_LOW_BAT_ACT": 2, "BAT_LOW_T": 0.1})
def test_a_failsafe_outlives_the_autopilot(sitl: Sitl) -> None:
    drain(sitl, 0.95)
    sitl.wait_until(lambda: sitl.mode is Mode.LAND, within=2.0)
    restart(sitl)
    sitl.run(1.5)
    assert sitl.mode is Mode.LAND
    assert reported_state(sitl) == mav.MAV_STATE_EMERGENCY
