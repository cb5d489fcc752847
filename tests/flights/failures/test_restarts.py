"""The autopilot is killed in flight and started again: with what was kept of the flight it goes on."""

from collections.abc import Callable
from math import degrees, hypot, nan

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode, State
from colibri.autopilot.core.checkpoint import FOLLOWS_US, History
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED, EVERY_KIND, QUICK, reached, restart

pytestmark = QUICK

HOLDING = State(Mode.HOLD, armed=True)
IN_THE_AIR = pytest.mark.sitl(airborne=3.0)


def state(sitl: Sitl) -> State:
    return sitl.inside.copter.pilot.state


def fly_mission(sitl: Sitl, *plan: items.Item) -> None:
    sitl.upload_mission(plan)
    sitl.select(Mode.MISSION)


def max_tilt_deg(sitl: Sitl, seconds: float) -> float:
    tilts: list[float] = []
    sitl.run(seconds, lambda: tilts.append(max(map(abs, sitl.euler[:2]))))
    return degrees(max(tilts))


def test_a_mission_goes_on_as_if_nothing_had_happened(sitl_fleet: Callable[..., list[Sitl]]) -> None:
    """Every kind of item, the take-off, the jump's count, the circle's turns and the way home among them."""

    def flown(*, killed: bool) -> Sitl:
        (sitl,) = sitl_fleet(1, params={"RTL_RETURN_ALT": 3.0, "COM_DISARM_LAND": 0.1})
        sitl.upload_mission(EVERY_KIND)
        assert sitl.command(mav.MAV_CMD_MISSION_START) == ACCEPTED
        sitl.arm()
        while sitl.armed:
            sitl.run(1.1)
            if killed and sitl.armed:
                restart(sitl)
                restarts.append(sitl.time_s)
        return sitl

    restarts: list[float] = []
    wanted, sitl = flown(killed=False), flown(killed=True)
    assert len(restarts) > 15
    assert reached(sitl) == reached(wanted) == [0, 1, 2, 3, 4, 3, 4, 5, 6, 7, 8, 9, 10, 11]
    assert hypot(*wanted.position[:2]) < 0.15
    assert wanted.said("Mission RTL item: return")
    frames = min(len(sitl.path), len(wanted.path))
    off_m = np.linalg.norm(sitl.path[:frames] - wanted.path[:frames], axis=1)
    assert off_m.max() < 0.6  # the circle is joined where it is nearest, which the restart finds again
    assert sitl.said("Restarted in flight: mission continues at item 3")
    assert sitl.said("Restarted in flight: return continues")
    charges_ah = [each.inside.copter.parts.battery.charge_ah for each in (sitl, wanted)]
    assert charges_ah[0] == pytest.approx(charges_ah[1], rel=0.01)


@pytest.mark.parametrize("missed", [30, pytest.param(1, marks=pytest.mark.long)])
@pytest.mark.parametrize("feedback", [pytest.param("state", marks=pytest.mark.long), "sensors"])
def test_a_restart_is_not_felt_in_hover_and_in_a_turn(
    sitl_fleet: Callable[..., list[Sitl]], feedback: str, missed: int
) -> None:
    """Frames are missed while an autopilot starts only where the plant does not wait for it."""
    (sitl,) = sitl_fleet(1, feedback=feedback)
    sitl.takeoff(3.0)
    sitl.run(0.5)
    height_m = sitl.position[2]
    sitl.inside.skip(missed)
    restart(sitl)
    assert max_tilt_deg(sitl, 2.0) < (3.0 if missed == 1 else 20.0)
    assert sitl.position[2] == pytest.approx(height_m, abs=0.15)
    fly_mission(sitl, items.waypoint(12.0, 0.0, 3.0), items.waypoint(4.0, 5.0, 3.0, stay_s=1.0))
    sitl.wait_until(lambda: reached(sitl) == [0], within=10.0)
    sitl.inside.skip(missed)
    restart(sitl)
    assert max_tilt_deg(sitl, 4.0) < 45.0
    sitl.wait_until(lambda: state(sitl) == HOLDING, within=15.0)
    assert sitl.is_at((4.0, 5.0, 3.0), 0.3 if feedback == "state" else 3.0, slow_m_s=1.0)


@pytest.mark.parametrize(
    ("flying_s", "height_m"), [(0.6, 5.0), *(pytest.param(each, 8.0, marks=pytest.mark.long) for each in (0.0, 4.0))]
)
@pytest.mark.feedback("sensors")
def test_without_memory_a_vehicle_on_sensors_is_caught(sitl: Sitl, flying_s: float, height_m: float) -> None:
    """Out of a hover, while it gains speed with 20 degrees of tilt, and at speed."""
    sitl.takeoff(height_m)
    if flying_s:
        sitl.goto(60.0, 20.0, height_m, wait=False)
        sitl.run(flying_s)
    height_m, since_s = sitl.position[2], sitl.time_s
    restart(sitl, lambda _: None)
    sitl.wait_until(lambda: state(sitl).armed, within=0.5)
    assert max_tilt_deg(sitl, 4.0) < 45.0
    sitl.run(2.0)
    assert sitl.flown(since_s)["z"].min() > height_m - 3.0
    assert sitl.speed_m_s < 0.2
    assert state(sitl) == HOLDING
    assert sitl.said("Restarted in flight without a record: falling")


@pytest.mark.long
@pytest.mark.feedback("sensors")
def test_a_caught_vehicle_goes_on_with_its_mission(sitl: Sitl) -> None:
    sitl.takeoff(7.0)
    fly_mission(sitl, items.waypoint(5.0, 0.0, 7.0, stay_s=2.0), items.waypoint(0.0, 5.0, 7.0))
    sitl.wait_until(lambda: reached(sitl) == [0], within=10.0)
    restart(sitl, lambda kept: kept._replace(checkpoint=kept.checkpoint._replace(state_source=b"")))
    sitl.run(0.5)
    sitl.wait_until(lambda: state(sitl) == HOLDING, within=20.0)
    assert sitl.said("Restarted in flight: mission continues at item 0")
    assert sitl.said("Restarted in flight without a record: falling")
    assert sitl.is_at((0.0, 5.0, 7.0), 3.0, slow_m_s=1.0)


@pytest.mark.sitl(airborne=3.0, profile="flight")
def test_between_control_samples_rotors_keep_their_speed(sitl: Sitl) -> None:
    sitl.run(1.0)
    for _ in range(2):
        sitl.step()
        before = sitl.rotors.controls
        restart(sitl)
        sitl.step()
        assert sitl.rotors.controls == pytest.approx(before, abs=1e-3)


@IN_THE_AIR
def test_offboard_waits_for_setpoints_as_after_a_loss(sitl: Sitl) -> None:
    def send() -> None:
        sitl.setpoint(velocity=(1.0, 0.0, 0.0))
        sitl.run(0.1)

    send()
    sitl.select(Mode.OFFBOARD)
    for _ in range(2):
        send()
        restart(sitl)
        sitl.run(0.9)
        assert sitl.mode is Mode.OFFBOARD
    sitl.run(0.2)
    assert sitl.said("Failsafe activated: setpoints lost, hold")


def test_plans_and_home_are_kept_on_the_ground_too(sitl: Sitl) -> None:
    sitl.upload_mission([items.waypoint(5.0, 0.0, 3.0), items.waypoint(0.0, 5.0, 3.0)])
    sitl.upload_rally([items.Item(mav.MAV_CMD_NAV_RALLY_POINT, (), (1.0, 1.0, 3.0))])
    sitl.upload_fence(items.circle(50.0))
    before = sitl.inside.copter
    before.pilot.home.move((1.0, 2.0, 0.0), 0.5)
    sitl.run(1.0)  # what stands is kept now and then
    restart(sitl)
    sitl.run(0.1)
    stations, pilot = sitl.inside.copter.stations, sitl.inside.copter.pilot
    assert repr(stations.plans.plans) == repr(before.stations.plans.plans)  # some numbers are nan
    refusal = stations.fence.refusal((60.0, 0.0, 1.0))
    assert refusal is not None
    assert "fence" in refusal.reason
    assert (pilot.home.position_enu_m, pilot.ground.standing, sitl.armed) == ((1.0, 2.0, 0.0), True, False)
    assert not sitl.said("restarted in flight")
    sitl.arm()
    restart(sitl)
    sitl.run(0.1)
    assert (sitl.armed, sitl.inside.copter.pilot.ground.standing) == (True, True)


@pytest.mark.sitl(airborne=1.0)
def test_a_mission_that_has_landed_does_not_begin_again(sitl: Sitl) -> None:
    """The rotors idle for a while after a landing, and the mode is still mission."""
    landing = items.Item(mav.MAV_CMD_NAV_LAND, (0.0, 0.0, 0.0, nan))
    fly_mission(sitl, items.waypoint(1.0, 0.0, 1.0), landing)
    sitl.wait_until(lambda: sitl.inside.copter.pilot.ground.standing, within=10.0)
    sitl.run(0.5)
    assert state(sitl) == State(Mode.MISSION, armed=True)
    restart(sitl)
    sitl.run(0.05)
    sitl.wait_until(lambda: not (sitl.armed and sitl.position[2] < 0.01), within=3.0)
    assert sitl.position[2] < 0.01
    assert sitl.mode is Mode.HOLD


@pytest.mark.parametrize("late_us", [-8_000, FOLLOWS_US + 8_000])
@IN_THE_AIR
def test_what_was_kept_of_another_flight_is_not_used(sitl: Sitl, late_us: int) -> None:
    fly_mission(sitl, items.waypoint(5.0, 0.0, 3.0))
    sitl.run(1.0)
    moved_us = sitl.time_us - late_us
    restart(sitl, lambda kept: kept._replace(checkpoint=kept.checkpoint._replace(time_us=moved_us)))
    sitl.run(0.1)
    assert state(sitl) == HOLDING
    assert not sitl.inside.copter.stations.missions.total


@IN_THE_AIR
def test_another_law_takes_over_what_was_commanded(sitl: Sitl) -> None:
    """It does not take over what the law before remembers."""
    sitl.goto(5.0, 0.0, 3.0, wait=False)
    sitl.run(1.0)
    restart(sitl, lambda kept: kept._replace(checkpoint=kept.checkpoint._replace(fingerprint=0)))
    sitl.run(4.0)
    assert hypot(sitl.position[0] - 5.0, sitl.position[1]) < 0.05


@pytest.mark.parametrize("keep", [lambda _: b"", lambda memory: memory[:-9], lambda _: b"\x93\x01\x02\x03"])
@IN_THE_AIR
def test_a_memory_that_cannot_be_read_begins_anew(sitl: Sitl, keep: Callable[[bytes], bytes]) -> None:
    def changed(kept: History) -> History:
        loop = kept.checkpoint.loop
        return kept._replace(checkpoint=kept.checkpoint._replace(loop=loop._replace(memory=keep(loop.memory))))

    sitl.run(0.5)
    restart(sitl, changed)
    sitl.run(1.0)
    assert sitl.position[2] == pytest.approx(3.0, abs=0.2)
    assert state(sitl) == HOLDING
