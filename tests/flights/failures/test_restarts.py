"""The autopilot is killed in flight and started again: with what was kept of the flight it goes on."""

from collections.abc import Callable
from math import degrees, dist, hypot, nan

import pytest

from colibri.autopilot.commander.rules.modes import Mode, State
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.checkpoint import FOLLOWS_US
from colibri.common.rotations import tilt_deg
from colibri.common.types import Vector
from colibri.mavlink.hil.faults import MOTOR, WRONG
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.mission.items import FENCE, RALLY
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.world import state_frame
from tests.flights.vehicle.test_vehicle_missions import EVERY_KIND, do, load, reached, waypoint
from tools.harness.copter_flight import ACCEPTED, DENIED, CopterFlight, in_the_air

EVERY_S = 1.1
HOLDING = State(Mode.HOLD, armed=True)


def path_of(flight: CopterFlight, seconds: float) -> list[Vector]:
    """Fly for so long; return where it was after each frame."""
    path: list[Vector] = []
    flight.run(seconds, lambda: path.append(flight.position))
    return path


def test_a_mission_goes_on_as_if_nothing_had_happened() -> None:
    """Every kind of item, the take-off, the jump's count, the circle's turns and the way home among them."""

    def flown(*, killed: bool) -> CopterFlight:
        flight = CopterFlight(values={"RTL_RETURN_ALT": 3.0, "COM_DISARM_LAND": 0.1})
        load(flight, *EVERY_KIND)
        assert flight.command(mav.MAV_CMD_MISSION_START) == ACCEPTED
        assert flight.arm() == ACCEPTED
        paths.append([])
        while flight.armed:
            paths[-1] += path_of(flight, EVERY_S)
            if killed and flight.armed:
                paths[-1].append(flight.position)
                flight.restart(flight.history())
                restarts.append(flight.time_s)
            elif flight.armed:
                paths[-1].append(flight.position)
                flight.step()
        return flight

    paths: list[list[Vector]] = []
    restarts: list[float] = []
    wanted, flight = flown(killed=False), flown(killed=True)
    assert len(restarts) > 15
    assert reached(flight) == reached(wanted)
    assert max(map(dist, *paths)) < 0.6  # the circle is joined where it is nearest, which the restart finds again
    assert flight.client.said("restarted in flight: mission goes on at item 3")
    assert flight.client.said("restarted in flight: return goes on")
    assert flight.copter.parts.battery.charge_ah == pytest.approx(wanted.copter.parts.battery.charge_ah, rel=0.01)


@pytest.mark.parametrize(
    "mode",
    [
        *(Mode.HOLD, Mode.TRACK, Mode.RETURN),
        *(pytest.param(mode, marks=pytest.mark.long) for mode in (Mode.TAKEOFF, Mode.LAND, Mode.ORBIT)),
    ],
)
def test_every_mode_goes_on(mode: Mode) -> None:
    flight = in_the_air(3.0)
    assert flight.goto(8.0, 3.0, 3.0) == ACCEPTED
    flight.run(2.0)
    if mode is Mode.ORBIT:
        assert flight.command(mav.MAV_CMD_DO_ORBIT, 4.0, 3.0, 0.0, 0.0, *[nan] * 3) == ACCEPTED
    elif mode is not Mode.HOLD:
        assert flight.select(mode) == ACCEPTED
    flight.run(6.0 if mode is Mode.ORBIT else 3.0)
    past, there = flight.history(), flight.world
    wanted, state = path_of(flight, 4.0), flight.copter.pilot.state
    flight.world = there
    flight.restart(past)
    flown = path_of(flight, 4.0)
    assert flight.copter.pilot.state == state
    assert max(map(dist, flown, wanted[1:])) < 0.01


def max_tilt_deg(flight: CopterFlight, seconds: float) -> float:
    """Fly for so long; return how far the vehicle was tilted at most."""
    tilts: list[float] = []
    flight.run(seconds, lambda: tilts.append(degrees(max(map(abs, flight.euler[:2])))))
    return max(tilts)


@pytest.mark.parametrize("missed", [30, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("feedback", list(Feedback))
def test_nothing_is_felt_in_hover_and_in_a_turn(feedback: Feedback, missed: int) -> None:
    """Frames are missed while an autopilot starts only where the plant does not wait for it."""
    flight = CopterFlight(feedback=feedback)
    flight.takeoff(4.0)
    height_m = flight.position[2]
    past = flight.history()
    flight.skip(missed)
    flight.restart(past)
    assert max_tilt_deg(flight, 2.0) < (3.0 if missed == 1 else 20.0)
    assert flight.position[2] == pytest.approx(height_m, abs=0.15)
    load(flight, waypoint(15.0, 0.0, 4.0), waypoint(0.0, 6.0, 4.0, stay_s=1.0))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.wait_until(lambda: reached(flight) == [0], within=10.0)
    past = flight.history()
    flight.skip(missed)
    flight.restart(past)
    assert max_tilt_deg(flight, 4.0) < 45.0
    flight.wait_until(lambda: flight.copter.pilot.state == HOLDING, within=15.0, what="the end of the mission")
    assert dist(flight.position, (0.0, 6.0, 4.0)) < (0.3 if feedback is Feedback.STATE else 3.0)


@pytest.mark.parametrize("flying_s", [4.0, *(pytest.param(each, marks=pytest.mark.long) for each in (0.0, 0.6))])
def test_a_vehicle_on_sensors_is_caught_by_an_autopilot_that_knows_nothing(flying_s: float) -> None:
    """Out of a hover, while it gains speed with 20 degrees of tilt, and at speed."""
    flight = CopterFlight(feedback=Feedback.SENSORS)
    flight.takeoff(8.0)
    if flying_s:
        assert flight.goto(60.0, 20.0, 8.0) == ACCEPTED
        flight.run(flying_s)
    height_m = flight.position[2]
    flight.restart()
    flight.wait_until(lambda: flight.armed, within=0.5)
    assert max_tilt_deg(flight, 4.0) < 45.0
    assert min(z for _, _, z in path_of(flight, 2.0)) > height_m - 3.0
    assert hypot(*flight.velocity) < 0.2
    assert flight.copter.pilot.state == HOLDING
    assert flight.client.said("restarted in the air, knowing nothing: found falling")


def test_what_was_asked_for_goes_on_when_a_vehicle_is_caught() -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS)
    flight.takeoff(12.0)
    load(flight, waypoint(5.0, 0.0, 12.0, stay_s=2.0), waypoint(0.0, 5.0, 12.0))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.wait_until(lambda: reached(flight) == [0], within=10.0)
    past = flight.history()
    flight.restart(past._replace(checkpoint=past.checkpoint._replace(state_source=b"")))
    flight.wait_until(lambda: flight.copter.pilot.state == HOLDING, within=20.0, what="the end of the mission")
    assert flight.client.said("restarted in flight: mission goes on at item 0")
    assert flight.client.said("found falling")
    assert dist(flight.position, (0.0, 5.0, 12.0)) < 3.0


def test_a_landing_on_three_rotors_goes_on() -> None:
    flight = in_the_air(8.0)
    assert flight.inject(MOTOR, WRONG, 2, 0.001) == ACCEPTED
    flight.run(1.5)
    flight.restart(flight.history())
    assert flight.copter.parts.rotor_loss.lost == 1
    tilts: list[float] = []

    def landed() -> bool:
        tilts.append(tilt_deg(state_frame(flight.world).attitude))
        return not flight.armed

    flight.wait_until(landed, within=20.0)
    assert max(tilts) < 20.0
    assert hypot(*flight.position[:2]) < 3.0
    assert flight.client.said("rotor 2 failed: landing on three rotors")
    assert flight.arm() == DENIED


def test_between_two_control_samples_the_rotors_keep_their_speed() -> None:
    flight = in_the_air(3.0, profile=load_profile("flight"))
    flight.run(1.0)
    for _ in range(2):
        flight.step()
        past, before = flight.history(), flight.rotors
        flight.restart(past)
        assert flight.rotors.controls == pytest.approx(before.controls, abs=1e-3)


def test_offboard_waits_for_setpoints_as_after_a_loss() -> None:
    flight = in_the_air(3.0)
    for _ in range(5):
        flight.setpoint(velocity=(1.0, 0.0, 0.0))
        flight.run(0.05)
    assert flight.select(Mode.OFFBOARD) == ACCEPTED
    flight.setpoint(velocity=(1.0, 0.0, 0.0))
    flight.run(0.1)
    flight.restart(flight.history())
    flight.run(0.9)
    assert flight.mode is Mode.OFFBOARD
    flight.setpoint(velocity=(1.0, 0.0, 0.0))
    flight.run(0.9)
    assert flight.mode is Mode.OFFBOARD
    flight.restart(flight.history())
    flight.run(1.1)
    assert flight.client.said("setpoints lost: hold")


def test_sticks_that_are_not_heard_again_are_lost() -> None:
    flight = in_the_air(3.0)
    flight.stick()
    flight.run(0.1)
    assert flight.select(Mode.POSITION) == ACCEPTED
    flight.restart(flight.history())
    flight.run(0.4)
    assert flight.mode is Mode.POSITION
    flight.run(0.2)
    assert flight.client.said("sticks lost: hold")


def test_a_ground_station_that_is_not_heard_again_is_lost() -> None:
    flight = CopterFlight(values={"NAV_DLL_ACT": 3, "COM_DL_LOSS_T": 1.0})
    flight.takeoff(3.0)
    flight.send("HEARTBEAT", mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3)
    flight.run(0.5)
    flight.restart(flight.history())
    flight.run(0.8)
    assert flight.mode is Mode.HOLD
    flight.run(0.4)
    assert flight.client.said("ground station lost: land")


def test_a_failsafe_that_the_pilot_has_overridden_does_not_begin_again() -> None:
    flight = CopterFlight(values={"COM_LOW_BAT_ACT": 1})
    flight.takeoff(3.0)
    flight.drain(0.9)
    flight.wait_until(lambda: flight.mode in (Mode.RETURN, Mode.LAND), within=3.0, what="the failsafe")
    assert flight.select(Mode.HOLD) == ACCEPTED
    flight.run(0.5)
    flight.restart(flight.history())
    flight.run(2.0)
    assert flight.copter.pilot.state == HOLDING


def test_plans_and_home_are_kept_on_the_ground_too() -> None:
    flight = CopterFlight()
    load(flight, waypoint(5.0, 0.0), waypoint(0.0, 5.0))
    service = flight.copter.stations.plans
    service.load(RALLY, [waypoint(1.0, 1.0)._replace(command=mav.MAV_CMD_NAV_RALLY_POINT)])
    circle = waypoint(0.0, 0.0)._replace(command=mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, p1=50.0)
    service.load(FENCE, [circle])
    flight.copter.pilot.home.move((1.0, 2.0, 0.0), 0.5)
    plans = dict(service.plans)
    flight.restart(flight.history())
    stations, pilot = flight.copter.stations, flight.copter.pilot
    assert stations.plans.plans == plans
    refusal = stations.fence.refusal((60.0, 0.0, 1.0))
    assert refusal is not None
    assert "fence" in refusal.reason
    assert (pilot.home.position_enu_m, pilot.ground.standing, flight.armed) == ((1.0, 2.0, 0.0), True, False)
    assert not flight.client.said("restarted in flight")
    assert flight.arm() == ACCEPTED
    flight.restart(flight.history())
    assert (flight.armed, flight.copter.pilot.ground.standing) == (True, True)


def test_a_mission_that_has_landed_does_not_begin_again() -> None:
    """The rotors idle for a while after a landing, and the mode is still mission."""
    flight = in_the_air(1.0)
    load(flight, waypoint(1.0, 0.0, 1.0), do(mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.wait_until(lambda: flight.copter.pilot.ground.standing, within=10.0)
    flight.run(0.5)
    assert flight.copter.pilot.state == State(Mode.MISSION, armed=True)
    flight.restart(flight.history())
    path = flight.path_until(lambda: not flight.armed, 3.0)
    assert max(z for _, _, z in path) < 0.01
    assert flight.mode is Mode.HOLD


@pytest.mark.parametrize("late_us", [-8_000, FOLLOWS_US + 8_000])
def test_another_flight_begins_anew(late_us: int) -> None:
    flight = in_the_air(3.0)
    load(flight, waypoint(5.0, 0.0))
    assert flight.select(Mode.MISSION) == ACCEPTED
    flight.run(1.0)
    kept, plans = flight.history()
    moved = kept._replace(time_us=flight.world.time_us - late_us)
    flight.restart(flight.history()._replace(checkpoint=moved))
    assert flight.copter.pilot.state == HOLDING
    assert not flight.copter.stations.missions.has_mission
    assert plans


def test_a_vehicle_that_came_down_meanwhile_stays_there() -> None:
    flight = CopterFlight()
    flight.takeoff(1.0)
    past = flight.history()
    flight.land()
    flight.restart(past)
    assert flight.copter.pilot.state == State(Mode.HOLD, armed=False)
    assert flight.copter.pilot.ground.standing
    flight.run(1.0)
    assert flight.arm() == ACCEPTED


def test_another_law_takes_over_what_was_asked_for_and_not_what_a_law_remembers() -> None:
    flight = in_the_air(3.0)
    assert flight.goto(5.0, 0.0, 3.0) == ACCEPTED
    flight.run(1.0)
    past = flight.history()
    flight.restart(past._replace(checkpoint=past.checkpoint._replace(fingerprint=0)))
    flight.run(5.0)
    assert hypot(flight.position[0] - 5.0, flight.position[1]) < 0.05


def fly_on_with(keep: Callable[[bytes], bytes]) -> None:
    """See the flight go on with what `keep` leaves of the law's memory."""
    flight = in_the_air(3.0)
    past = flight.history()
    loop = past.checkpoint.loop
    flight.restart(past._replace(checkpoint=past.checkpoint._replace(loop=loop._replace(memory=keep(loop.memory)))))
    flight.run(1.0)
    assert flight.position[2] == pytest.approx(3.0, abs=0.2)


def test_a_memory_that_cannot_be_read_is_begun_anew() -> None:
    for keep in (lambda _: b"", lambda memory: memory[:-9], lambda _: b"\x93\x01\x02\x03"):
        fly_on_with(keep)
