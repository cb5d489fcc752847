"""What the vehicle does when something is lost, flown; the scenarios of group failsafes fly the other rows."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK, in_mode, latest, restart

pytestmark = QUICK

RETURN, LAND = 2, 3


def reported_state(sitl: Sitl) -> int:
    sitl.run(0.1)
    return int(sitl.gcs.latest("HEARTBEAT").system_status)


def charge_state(sitl: Sitl) -> int:
    return int(latest(sitl, "BATTERY_STATUS").charge_state)


@pytest.mark.sitl(airborne=10.0, params={"NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 2.0})
def test_any_ground_station_will_do(sitl: Sitl) -> None:
    other = sitl.client(250)
    sitl.run(0.5)
    sitl.gcs.silent = True
    sitl.run(3.0)
    assert sitl.mode is Mode.HOLD
    other.silent = True
    sitl.run(2.1)
    assert in_mode(sitl, Mode.RETURN)


@pytest.mark.sitl(airborne=10.0, params={"NAV_RCL_ACT": LAND})
def test_lost_sticks_lead_to_what_is_set(sitl: Sitl) -> None:
    with sitl.sticks_held():
        sitl.run(0.05)
        sitl.select(Mode.POSITION)
    sitl.run(1.0)
    assert in_mode(sitl, Mode.LAND)
    assert reported_state(sitl) == mav.MAV_STATE_EMERGENCY


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
    assert sitl.said("Failsafe activated: battery critical, land")


@pytest.mark.sitl(
    without=["battery"], airborne=2.0, params={"COM_LOW_BAT_ACT": 2, "BAT_LOW_T": 0.1, "BAT_CRIT_VOLT": 30.0}
)
def test_a_plant_without_battery_has_none_that_is_low(sitl: Sitl) -> None:
    sitl.run(1.5)
    assert sitl.mode is Mode.HOLD
    assert not sitl.said("Failsafe activated: battery critical, land")


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
    assert sitl.said("Failsafe: telemetry missed, return continues")
    sitl.select(Mode.HOLD)
    sitl.run(1.2)
    assert sitl.said("Failsafe cleared: telemetry missed")


def test_a_control_law_that_finds_no_plan_stops(sitl_fleet: Callable[..., list[Sitl]]) -> None:
    flight = load_profile("flight")
    law = flight.table("lpv-mpc")
    hopeless = {"lpv-mpc": {**law, "qp": {**law["qp"], "max_iterations": 1}}}
    (sitl,) = sitl_fleet(1, airborne=20.0, track="lemniscate:lap=2", profile=replace(flight, controllers=hopeless))
    sitl.select(Mode.TRACK)
    assert sitl.wait_until(lambda: sitl.mode is Mode.HOLD, within=1.0) == pytest.approx(0.5, abs=0.05)
    sitl.step()
    assert sitl.said("Failsafe activated: no MPC solution, hold")


@pytest.mark.sitl(airborne=8.0, params={"COM_LOW_BAT_ACT": 2, "BAT_LOW_T": 0.1})
def test_a_failsafe_outlives_the_autopilot(sitl: Sitl) -> None:
    sitl.inject("battery", "wrong", 0, 0.05)
    sitl.wait_until(lambda: sitl.mode is Mode.LAND, within=2.0)
    restart(sitl)
    sitl.run(1.5)
    assert sitl.mode is Mode.LAND
    assert reported_state(sitl) == mav.MAV_STATE_EMERGENCY
