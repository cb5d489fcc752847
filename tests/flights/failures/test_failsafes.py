"""What the vehicle does when something is lost: each row of the failsafes' table, flown."""

from math import hypot

import pytest
from msgspec import structs

from colibri.autopilot.commander.rules.failsafe_table import Condition
from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.hil.faults import MOTOR, OFF
from colibri.mavlink.mission.items import FENCE, MissionItem
from colibri.mavlink.wire.dialect import mav
from tools.harness.client import Client
from tools.harness.copter_flight import ACCEPTED, DENIED, FLIGHT, CopterFlight, in_the_air

SAMPLE_S = 0.008
RETURN, LAND = 2, 3
CIRCLE = mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION


def heartbeat(client: Client) -> None:
    """Be a ground station."""
    client.send("HEARTBEAT", mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3)


def state_told(flight: CopterFlight) -> int:
    """The MAV_STATE of the last HEARTBEAT."""
    return int(flight.client.latest("HEARTBEAT").system_status)


def flies(flight: CopterFlight, mode: Mode) -> bool:
    return flight.mode is mode


def heard_every_second(flight: CopterFlight, seconds: float) -> None:
    for _ in range(round(seconds)):
        heartbeat(flight.client)
        flight.run(1.0)


def fence_of(flight: CopterFlight, radius_m: float) -> None:
    """Load a fence: a circle around the origin."""
    origin = flight.copter.pilot.home.origin
    place = (round(origin.latitude_deg * 1e7), round(origin.longitude_deg * 1e7), 0.0)
    item = MissionItem(mav.MAV_FRAME_GLOBAL, CIRCLE, 0, radius_m, 0.0, 0.0, 0.0, *place)
    flight.copter.stations.plans.load(FENCE, (item,))


def test_a_lost_ground_station_leads_home_after_the_time_that_is_set_and_clears() -> None:
    flight = in_the_air(10.0, values={"NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 2.0})
    heard_every_second(flight, 2.0)
    flight.set_param("COM_DL_LOSS_T", 4.0)
    flight.run(2.0)  # the last was 1 s ago: half as long again as the old time
    assert flies(flight, Mode.HOLD)
    assert not flight.client.said("lost")
    silent_s = 3.0 + flight.wait_until(lambda: flight.mode is Mode.RETURN, within=2.0, what="the return")
    assert silent_s == pytest.approx(4.0, abs=0.03)
    flight.run(0.1)
    assert flight.client.said("ground station lost: return")
    assert state_told(flight) == mav.MAV_STATE_CRITICAL
    heard_every_second(flight, 3.0)
    assert flight.client.said("ground station lost: cleared")
    assert flies(flight, Mode.RETURN)
    assert flight.select(Mode.HOLD) == ACCEPTED
    flight.run(0.1)
    assert state_told(flight) == mav.MAV_STATE_ACTIVE


def test_any_ground_station_will_do_and_who_never_had_one_loses_none() -> None:
    flight = in_the_air(values={"NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 1.0})
    flight.run(2.0)
    assert flies(flight, Mode.HOLD)
    heartbeat(flight.client)
    flight.run(0.5)
    other = flight.add(Client(system=250, port=14600))
    for _ in range(4):
        heartbeat(other)
        flight.run(0.5)
    assert flies(flight, Mode.HOLD)
    flight.run(0.6)
    assert flies(flight, Mode.RETURN)


def test_sticks_lost_before_the_take_off_stop_the_rotors_within_a_second() -> None:
    flight = CopterFlight()
    assert flight.select(Mode.POSITION) == ACCEPTED
    flight.stick(thrust=0.0)
    flight.step()
    assert flight.arm() == ACCEPTED
    assert flight.wait_until(lambda: not flight.armed, within=1.0, what="disarming") == pytest.approx(0.5, abs=0.05)
    flight.step()
    assert flight.client.said("sticks lost: rotors stop")
    assert state_told(flight) != mav.MAV_STATE_FLIGHT_TERMINATION


@pytest.mark.parametrize(("choice", "mode"), [(3, Mode.RETURN), (4, Mode.LAND), (5, Mode.HOLD)])
def test_a_companion_that_falls_silent_is_left_at_the_time_that_is_set(choice: int, mode: Mode) -> None:
    flight = in_the_air(10.0, values={"COM_OBL_RC_ACT": choice, "COM_OF_LOSS_T": 0.8})
    flight.setpoint(velocity=(1.0, 0.0, 0.0))
    flight.step()
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    flight.setpoint(velocity=(1.0, 0.0, 0.0))
    flight.step()
    heard_s = flight.time_s
    flight.wait_until(lambda: flight.mode is mode, within=1.0, what="the action")
    assert flight.time_s - heard_s == pytest.approx(0.8, abs=2 * SAMPLE_S)
    for _ in range(30):
        flight.setpoint(velocity=(1.0, 0.0, 0.0))
        flight.run(0.05)
    assert flies(flight, mode)
    assert flight.client.said("setpoints lost: cleared")


@pytest.mark.parametrize(("choice", "mode"), [(RETURN, Mode.RETURN), (LAND, Mode.LAND)])
def test_a_pilot_who_falls_silent_is_followed_by_what_is_set(choice: int, mode: Mode) -> None:
    flight = in_the_air(10.0, values={"NAV_RCL_ACT": choice})
    flight.stick()
    flight.step()
    assert flight.select(Mode.POSITION) == ACCEPTED
    flight.run(1.0)
    assert flies(flight, mode)
    flight.run(0.1)
    wanted = {Mode.RETURN: mav.MAV_STATE_CRITICAL, Mode.LAND: mav.MAV_STATE_EMERGENCY}
    assert state_told(flight) == wanted[mode]


def charge_state(flight: CopterFlight) -> int:
    flight.command(mav.MAV_CMD_REQUEST_MESSAGE, float(mav.MAVLINK_MSG_ID_BATTERY_STATUS))
    return int(flight.client.latest("BATTERY_STATUS").charge_state)


def test_a_low_battery_leads_home_and_a_critical_one_down_and_nothing_later_up_again() -> None:
    flight = in_the_air(5.0, values={"COM_LOW_BAT_ACT": 1, "NAV_DLL_ACT": RETURN, "COM_DL_LOSS_T": 3.0})
    heartbeat(flight.client)
    assert charge_state(flight) == mav.MAV_BATTERY_CHARGE_STATE_OK
    flight.drain(0.87)
    assert flight.wait_until(lambda: flight.mode is Mode.RETURN, within=2.0) == pytest.approx(
        1.0, abs=0.05
    )  # BAT_LOW_T
    assert charge_state(flight) == mav.MAV_BATTERY_CHARGE_STATE_LOW
    flight.drain(0.07)
    flight.wait_until(lambda: flight.mode is Mode.LAND, within=2.0)
    assert charge_state(flight) == mav.MAV_BATTERY_CHARGE_STATE_CRITICAL
    flight.wait_until(lambda: flight.client.said("ground station lost: land goes on"), within=2.0)
    flight.wait_until(lambda: not flight.armed, within=15.0, what="the landing")
    assert flight.arm() == DENIED
    assert flight.client.said("battery critical")


def test_a_voltage_below_its_limit_counts_as_the_charge_does() -> None:
    flight = in_the_air(5.0, values={"COM_LOW_BAT_ACT": 1, "BAT_LOW_T": 0.5})
    battery = flight.copter.parts.battery.state()
    assert battery is not None
    flight.set_param("BAT_LOW_VOLT", battery.voltage_v + 0.5)
    flight.run(0.6)
    assert flies(flight, Mode.RETURN)
    assert charge_state(flight) == mav.MAV_BATTERY_CHARGE_STATE_LOW
    flight.set_param("BAT_CRIT_VOLT", battery.voltage_v + 0.5)
    flight.run(0.6)
    assert flies(flight, Mode.LAND)
    assert charge_state(flight) == mav.MAV_BATTERY_CHARGE_STATE_CRITICAL
    assert flight.client.said("battery critical: land")


def test_by_default_a_battery_is_only_spoken_of() -> None:
    flight = in_the_air(3.0)
    flight.drain(0.97)
    flight.run(1.2)
    assert flies(flight, Mode.HOLD)
    assert flight.client.said("battery nearly empty")


def test_held_inside_of_the_fence_by_sticks_that_push_against_it() -> None:
    """At a radius of 15 m and a margin of 3 m it stays at 12 m, within 1 m."""
    flight = in_the_air(5.0, values={"GF_MARGIN": 3.0, "GF_PREDICT": 1})
    fence_of(flight, 15.0)
    flight.stick()
    flight.step()
    assert flight.select(Mode.POSITION) == ACCEPTED

    def away_m() -> float:
        return hypot(*flight.position[:2])

    def push(seconds: float) -> list[float]:
        found = []
        for _ in range(round(seconds * 10)):
            flight.stick(pitch=1.0)
            flight.run(0.1)
            found.append(away_m())
        return found

    assert max(push(7.0)) < 13.0
    held = push(3.0)
    assert 11.0 < min(held) < max(held) < 13.0
    assert flight.client.said("geofence breached: hold")
    assert flight.goto(14.0, 9.0, 5.0) == DENIED
    assert flight.goto(0.0, 0.0, 5.0) == ACCEPTED
    flight.run(4.0)
    assert away_m() < 8.0
    assert flight.client.said("geofence breached: cleared")


@pytest.mark.parametrize(
    ("values", "setpoint"),
    [({"GF_MAX_HOR_DIST": 4.0}, (2.0, 0.0, 0.0)), ({"GF_MAX_VER_DIST": 6.0}, (0.0, 0.0, 2.0))],
)
def test_a_breach_of_the_fence_around_home_leads_home(
    values: dict[str, float], setpoint: tuple[float, float, float]
) -> None:
    flight = in_the_air(5.0, values={"GF_ACTION": 3, "RTL_RETURN_ALT": 5.0, **values})
    flight.setpoint(velocity=setpoint)
    flight.step()
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    for _ in range(80):
        flight.setpoint(velocity=setpoint)
        flight.run(0.1)
        if flight.mode is Mode.RETURN:
            break
    assert flies(flight, Mode.RETURN)
    assert flight.goto(5.0, 0.0, 7.0) == DENIED
    flight.wait_until(lambda: hypot(*flight.position[:2]) < 0.5 and flight.position[2] < 5.0, within=30.0, what="home")
    flight.run(1.2)
    assert flight.client.said("geofence breached: cleared")


def test_tilted_too_far_is_said_and_ends_the_flight_only_where_that_is_allowed() -> None:
    for breaker, armed in ((121212, True), (0, False)):
        flight = in_the_air(20.0, values={"CBRK_FLIGHTTERM": breaker, "FD_FAIL_R": 30.0, "FD_FAIL_P": 30.0})
        flight.stick()
        flight.step()
        assert flight.select(Mode.STABILIZED) == ACCEPTED
        for _ in range(12):
            flight.stick(roll=1.0)
            flight.run(0.1)
        assert flight.armed is armed
        assert flight.client.said("tilted too far")
    assert state_told(flight) == mav.MAV_STATE_FLIGHT_TERMINATION
    assert flight.client.said("tilted too far: rotors stop")


def test_frames_that_are_missed_lead_to_what_is_set() -> None:
    flight = in_the_air(5.0, values={"COM_TEL_LOSS_ACT": 1, "COM_TEL_LOSS_T": 0.1})
    assert flight.select(Mode.RETURN) == ACCEPTED
    flight.run(0.5)
    flight.skip(5)
    flight.run(0.1)
    assert not flight.client.said("telemetry missed")
    flight.skip(25)
    flight.run(0.1)
    assert flight.client.said("telemetry missed: return goes on")
    assert flight.select(Mode.HOLD) == ACCEPTED
    flight.run(1.2)
    assert flight.client.said("telemetry missed: cleared")


def test_a_rotor_that_failed_leads_down() -> None:
    flight = in_the_air(5.0)
    flight.run(0.4)
    assert flight.inject(MOTOR, OFF, 2) == ACCEPTED
    flight.run(1.5)
    assert flies(flight, Mode.LAND)
    assert flight.client.said("rotor 2 failed: landing on three rotors")
    assert flight.copter.parts.supervisor.holds(Condition.ROTOR_FAILED)
    assert state_told(flight) == mav.MAV_STATE_EMERGENCY


def test_a_control_law_that_finds_no_plan_stops() -> None:
    table = FLIGHT.table("lpv-mpc")
    hopeless = {**table, "qp": {**table["qp"], "max_iterations": 1}}
    laws = {**FLIGHT.controllers, "lpv-mpc": hopeless}
    profile = structs.replace(FLIGHT, controller="lpv-mpc", controllers=laws)
    flight = in_the_air(20.0, profile=profile)
    assert flight.select(Mode.TRACK) == ACCEPTED
    assert flight.wait_until(lambda: flight.mode is Mode.HOLD, within=1.0) == pytest.approx(0.5, abs=0.05)
    flight.step()
    assert flight.client.said("control law finds no plan: hold")


def test_a_failsafe_outlives_the_autopilot() -> None:
    flight = in_the_air(8.0, values={"COM_LOW_BAT_ACT": 2, "BAT_LOW_T": 0.1})
    flight.drain(0.95)
    flight.run(0.5)
    assert flies(flight, Mode.LAND)
    flight.restart(flight.history())
    flight.run(1.5)
    assert flies(flight, Mode.LAND)
    assert state_told(flight) == mav.MAV_STATE_EMERGENCY
