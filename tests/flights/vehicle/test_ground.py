"""From the ground and back: arming, take-off, landing, return."""

from collections.abc import Callable
from math import hypot, nan

import pytest

from colibri.autopilot.commander.rules.modes import FIRST, Mode
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import starting_world
from colibri.plant.vehicle.description import load_vehicle
from colibri.sitl.vehicle import FORCE, Sitl
from tests.support.flying import ACCEPTED, DENIED, QUICK, in_mode, refused, restart

pytestmark = QUICK

ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM


def test_rotors_idle_when_armed_and_stop_when_disarmed(sitl: Sitl) -> None:
    assert sitl.mode is Mode.HOLD
    for _ in range(2):  # the second changes nothing
        sitl.arm()
    sitl.run(1.1)
    assert sitl.gcs.latest("HEARTBEAT").base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
    assert sitl.inside.world.rotor_speeds == pytest.approx((83.8,) * 4, rel=0.01)
    for _ in range(2):
        sitl.disarm()
    sitl.run(0.5)
    assert max(sitl.inside.world.rotor_speeds) < 1.0
    for param in (2.0, 0.5, -1.0, nan, 1e30):
        assert sitl.command(ARM, param) == DENIED
    assert sitl.said("Armed")
    assert sitl.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


def test_takeoff_hover_and_landing(sitl: Sitl) -> None:
    def landed_state() -> int:
        return int(sitl.gcs.latest("EXTENDED_SYS_STATE").landed_state)

    sitl.run(0.6)
    assert landed_state() == mav.MAV_LANDED_STATE_ON_GROUND
    sitl.arm()
    assert sitl.command(mav.MAV_CMD_NAV_TAKEOFF, *(nan,) * 7) == ACCEPTED
    assert sitl.mode is Mode.TAKEOFF
    sitl.wait_until(lambda: sitl.position[2] > 0.5, within=3.0)
    sitl.run(0.6)
    assert landed_state() == mav.MAV_LANDED_STATE_TAKEOFF
    sitl.run(4.0)
    assert sitl.path[:, 2].max() < 2.51
    assert in_mode(sitl, Mode.HOLD)
    assert sitl.position == pytest.approx((0.0, 0.0, 2.5), abs=0.01)
    assert landed_state() == mav.MAV_LANDED_STATE_IN_AIR
    refused(sitl, "Disarming denied: not landed", sitl.disarm)
    assert sitl.armed
    assert sitl.command(mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan) == ACCEPTED
    sitl.wait_until(lambda: sitl.position[2] < 0.05, within=5.0)
    assert sitl.velocity[2] == pytest.approx(-0.7, abs=0.05)  # MPC_LAND_SPEED
    sitl.wait_until(lambda: sitl.said("Landing detected"), within=2.0)
    stood_s = sitl.wait_until(lambda: not sitl.armed, within=5.0)
    assert stood_s == pytest.approx(2.0, abs=0.02)  # COM_DISARM_LAND
    assert sitl.inside.copter.pilot.state == FIRST
    sitl.step()
    assert sitl.said("Disarmed by landing")
    assert sitl.position == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    sitl.arm()  # the height is forgotten
    sitl.run(1.0)
    assert sitl.position[2] == pytest.approx(0.0, abs=0.01)


def test_a_takeoff_in_the_air_never_sinks(sitl: Sitl) -> None:
    sitl.takeoff(1.5)
    before, since_s = sitl.position[2], sitl.time_s

    def climb_to(height_m: float) -> int:
        return sitl.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, height_m)

    assert climb_to(1.0) == ACCEPTED
    sitl.run(1.0)
    assert sitl.flown(since_s)["z"].min() > before - 0.01
    assert sitl.mode is Mode.HOLD
    assert climb_to(2.0) == ACCEPTED
    sitl.run(3.0)
    assert sitl.position[2] == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("command", [(ARM, 0.0, FORCE), (mav.MAV_CMD_DO_FLIGHTTERMINATION, 1.0)])
@pytest.mark.sitl(airborne=2.0)
def test_force_stops_the_rotors_in_the_air(sitl: Sitl, command: tuple[float, ...]) -> None:
    assert sitl.command(int(command[0]), *command[1:]) == ACCEPTED
    assert not sitl.armed
    refused(sitl, "not on the ground", sitl.arm)
    assert sitl.said("Disarmed in flight")
    standing = lambda: sitl.inside.copter.pilot.ground.standing  # noqa: E731
    assert sitl.wait_until(standing, within=5.0) > 0.6
    assert not any(sitl.rotors.controls)
    sitl.arm()
    sitl.run(0.5)
    assert sitl.position[2] < 0.1


@pytest.mark.sitl(airborne=2.0)
def test_a_falling_vehicle_armed_by_force_recovers(sitl: Sitl) -> None:
    sitl.disarm(force=True)
    fallen = starting_world(Start(z=20.0, vx=2.0, vz=-5.0, p=1.0), load_vehicle("hummingbird"))
    sitl.inside.world = fallen._replace(time_us=sitl.time_us)
    sitl.run(0.2)
    assert sitl.velocity[2] < -6.0
    sitl.arm(force=True)
    sitl.run(3.0)
    assert sitl.position[2] > 10.0
    assert sitl.speed_m_s < 0.1


@pytest.mark.sitl(airborne=2.0, params={"RTL_RETURN_ALT": 4.0, "RTL_MIN_DIST": 2.0, "COM_DISARM_LAND": 0.2})
def test_return_climbs_flies_home_and_lands(sitl: Sitl) -> None:
    sitl.goto(4.0, -3.0, 2.0)
    since_s = sitl.time_s
    assert sitl.command(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    assert sitl.mode is Mode.RETURN
    sitl.wait_until(lambda: not sitl.armed, within=40.0)
    flown = sitl.flown(since_s)
    assert 3.7 < flown["z"].max() < 4.05
    far_low = (flown["x"] ** 2 + flown["y"] ** 2 > 1.0) & (flown["z"] < 3.5)
    assert max(((flown["x"] - 4.0) ** 2 + (flown["y"] + 3.0) ** 2)[far_low]) < 0.25
    assert hypot(*sitl.position[:2]) < 0.1


@pytest.mark.sitl(airborne=1.0, params={"COM_DISARM_LAND": 0.2})
def test_close_to_home_return_does_not_climb(sitl: Sitl) -> None:
    sitl.goto(2.0, 0.0, 1.0)
    sitl.select(Mode.RETURN)
    sitl.wait_until(lambda: not sitl.armed, within=20.0)
    assert sitl.path[:, 2].max() < 1.1
    assert hypot(*sitl.position[:2]) < 0.1


@pytest.mark.sitl(airborne=1.0)
def test_an_autopilot_without_memory_holds_in_mid_air(sitl: Sitl) -> None:
    sitl.goto(20.0, 0.0, 1.0, wait=False)
    sitl.wait_until(lambda: sitl.velocity[0] > 3.0, within=5.0)
    restart(sitl, lambda _: None)
    sitl.run(3.0)
    assert (sitl.mode, sitl.armed) == (Mode.HOLD, True)
    assert sitl.speed_m_s < 0.05
    assert sitl.position[2] == pytest.approx(1.0, abs=0.2)
    sitl.land()
    sitl.arm()


@pytest.mark.sitl(params={"COM_DISARM_LAND": 0.2})
def test_the_battery_is_counted_across_flights(sitl: Sitl) -> None:
    sitl.takeoff(0.5)
    sitl.run(1.0)
    sitl.select(Mode.LAND)
    sitl.wait_until(lambda: sitl.inside.copter.pilot.ground.standing, within=8.0)
    sitl.disarm()  # by hand, before it disarms itself
    assert sitl.mode is Mode.HOLD
    sitl.takeoff(0.5)
    sitl.run(1.0)
    sitl.land()
    sitl.run(0.6)
    consumed_mah = sitl.gcs.latest("BATTERY_STATUS").current_consumed
    assert consumed_mah == pytest.approx(1e3 * sitl.inside.world.charge_used_ah, abs=1.0)
    assert consumed_mah > 15


@pytest.mark.parametrize(
    ("vehicle", "wind"),
    [
        pytest.param("hummingbird", "2@0", marks=pytest.mark.long),
        ("hummingbird", "12@215"),
        pytest.param("iris", "12@37", marks=pytest.mark.long),
    ],
)
@pytest.mark.sitl(controller="geometric-se3", airborne=1.0, params={"COM_DISARM_LAND": 0.5})
def test_geometric_law_lands_upright_in_wind(sitl_fleet: Callable[..., list[Sitl]], vehicle: str, wind: str) -> None:
    (sitl,) = sitl_fleet(1, wind=wind, vehicle=vehicle)
    sitl.run(1.0)
    sitl.land()
    sitl.run(1.0)
    assert sitl.tilt_deg < 1.0


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.LAND])
@pytest.mark.sitl(airborne=1.0, vehicle="jmavsim")
def test_a_low_and_fast_vehicle_brakes_before_it_comes_down(sitl: Sitl, mode: Mode) -> None:
    sitl.goto(80.0, 0.0, 0.3, wait=False)
    sitl.run(3.0)
    assert sitl.speed_m_s > 4.0
    sitl.select(mode)
    low_at_m_s = []
    sitl.run(6.0, lambda: low_at_m_s.append(sitl.speed_m_s if sitl.position[2] < 0.05 else 0.0))
    assert max(low_at_m_s) < 1.0
    assert not sitl.said("Impact")
