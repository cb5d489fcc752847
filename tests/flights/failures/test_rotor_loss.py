"""A rotor is lost in flight: the vehicle says so, gives up yaw, stays upright and lands; whatever flew it before."""

from math import dist, hypot

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.rotor_loss.detector import RotorWatch
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.flight_record import tilt_deg
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK, refused, restart

pytestmark = [QUICK, pytest.mark.sitl(params={"COM_DISARM_LAND": 0.1})]

NEXT_TO_NONE = 0.001
"""Part of the thrust that is left of a rotor without its blades: it is gone at once, which is the worst that can be."""
HIGH = pytest.mark.sitl(airborne=6.0)


def fall(sitl: Sitl, rotor: int, *, peak_deg: float = 35.0, settled_deg: float = 20.0, away_m: float = 2.0) -> None:
    """Take a rotor away, fly until the vehicle rests, and see how far it tilted: at most, and from 1 s after on."""
    place, began_s = sitl.position, sitl.time_s
    sitl.inject("motor", "wrong", rotor + 1, NEXT_TO_NONE)
    loss = sitl.inside.copter.parts.rotor_loss
    assert 0.0 < sitl.wait_until(lambda: loss.lost is not None, within=1.0) <= 0.05
    sitl.wait_until(lambda: not sitl.armed, within=30.0)
    flown = sitl.flown(began_s)
    tilts = tilt_deg(flown)
    assert tilts.max() < peak_deg
    assert tilts[flown["t"] > began_s + 1.0].max() < settled_deg
    assert dist(sitl.position[:2], place[:2]) < away_m
    assert -flown["vz"][flown["z"] < 0.5].min() < 1.2
    assert abs(flown["r"]).max() < 30.0
    sitl.run(1.0)
    assert sitl.tilt_deg < 1.0


@pytest.mark.parametrize("rotor", [0, *(pytest.param(rotor, marks=pytest.mark.long) for rotor in range(1, 4))])
@HIGH
def test_it_lands_upright_on_three_rotors(sitl: Sitl, rotor: int) -> None:
    sitl.run(0.4)
    fall(sitl, rotor)
    assert sitl.said(f"rotor {rotor + 1} failed: landing on three rotors")
    assert sitl.said("Disarmed by landing")


@pytest.mark.sitl(feedback="sensors", seed=3)
def test_it_lands_on_sensors(sitl: Sitl) -> None:
    sitl.takeoff(6.0)
    fall(sitl, 3)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["stuck", "off", "wrong", "slow", "garbage"])
@pytest.mark.sitl(feedback="sensors", seed=2, wind="5@90")
def test_it_lands_without_an_accelerometer(sitl: Sitl, kind: str) -> None:
    sitl.takeoff(5.0)
    sitl.inject("motor", "off", 3)
    sitl.run(0.5)
    sitl.inject("accel", kind)
    sitl.wait_until(lambda: not (sitl.armed and sitl.position[2] > 0.01), within=20.0)
    assert sitl.position[2] < 0.1
    assert -sitl.velocity[2] < 1.2
    sitl.wait_until(lambda: not sitl.armed, within=10.0)
    assert sitl.said("Disarmed by landing")


@pytest.mark.long
@HIGH
@pytest.mark.sitl(controller="geometric-se3")
def test_any_control_law_may_have_flown_before(sitl: Sitl) -> None:
    sitl.run(0.4)
    fall(sitl, 2)


HEXAROTOR = pytest.mark.sitl(vehicle="firefly", controller="geometric-se3")  # the law with less machine code
MUST_LAND = pytest.mark.sitl(params={"CA_FAILURE_MODE": 2})


@pytest.mark.parametrize(
    "mode",
    [1, pytest.param(2, marks=[HEXAROTOR, MUST_LAND, pytest.mark.long], id="a hexarotor that must land")],
)
@pytest.mark.sitl(airborne=3.0)
def test_with_a_lost_rotor_only_landing_is_possible(sitl: Sitl, mode: int) -> None:
    sitl.run(0.4)
    sitl.inject("motor", "off", 2)
    sitl.run(0.6)
    assert sitl.mode is Mode.LAND
    assert sitl.gcs.latest("HEARTBEAT").system_status == mav.MAV_STATE_EMERGENCY
    refused(sitl, "hold refused: rotor 2 failed", sitl.select, Mode.HOLD)
    sitl.wait_until(lambda: not sitl.armed, within=20.0)
    refused(sitl, "Arming denied: rotor 2 failed", sitl.arm)
    refused(sitl, "", sitl.arm, force=True)
    sitl.set_param("CA_FAILURE_MODE", 0)
    sitl.set_param("CA_FAILURE_MODE", mode)
    sitl.arm()


REMAINING = {
    "firefly": ("5 rotors, yaw given up", range(6)),
    "s1000": ("7 rotors", (0, 3, 7)),
    "x8": ("7 rotors", (0, 3, 7)),
    "y6": ("5 rotors", (0, 3)),
}
"""What vehicles fly on with, and the rotors that they lose; those of x8 and y6 are coaxial."""
LOST = [
    pytest.param(
        *(rotor, remaining),
        id=f"{vehicle}-{rotor}",
        marks=[pytest.mark.sitl(vehicle=vehicle), pytest.mark.long],
    )
    for vehicle, (remaining, rotors) in REMAINING.items()
    for rotor in rotors
] + [pytest.param(0, REMAINING["firefly"][0], marks=HEXAROTOR, id="se3")]


@pytest.mark.parametrize(("rotor", "remaining"), LOST)
@pytest.mark.sitl(airborne=4.0)
def test_a_vehicle_flies_on_with_enough_rotors(sitl: Sitl, rotor: int, remaining: str) -> None:
    sitl.run(1.0)
    place, began_s = sitl.position, sitl.time_s
    sitl.inject("motor", "wrong", rotor + 1, NEXT_TO_NONE)
    sitl.run(4.0)
    assert sitl.inside.copter.parts.rotor_loss.lost == rotor
    assert sitl.said(f"rotor {rotor + 1} failed: flying on {remaining}")
    flown = sitl.flown(began_s)
    assert max(dist((x, y, z), place) for x, y, z in zip(flown["x"], flown["y"], flown["z"], strict=True)) < 0.2
    assert abs(flown["r"]).max() < 0.5
    assert sitl.mode is Mode.HOLD
    sitl.select(Mode.LAND)
    sitl.wait_until(lambda: not sitl.armed, within=20.0)
    assert dist(sitl.position[:2], place[:2]) < 0.2
    assert sitl.tilt_deg < 1.0
    refused(sitl, f"Arming denied: rotor {rotor + 1} failed", sitl.arm)


@HIGH
def test_a_rotor_lost_at_speed_is_survived(sitl: Sitl) -> None:
    sitl.goto(100.0, 0.0, 6.0, speed=5.0, wait=False)
    sitl.run(4.0)
    assert hypot(*sitl.velocity) > 4.5
    fall(sitl, 0, peak_deg=90.0, settled_deg=25.0, away_m=50.0)


@pytest.mark.parametrize("memory", [True, pytest.param(False, marks=pytest.mark.long)])
@pytest.mark.sitl(airborne=5.0)
def test_a_restarted_autopilot_lands_on_three_rotors(sitl: Sitl, memory: bool) -> None:
    sitl.run(0.4)
    sitl.inject("motor", "off", 4)
    sitl.run(2.5)
    restart(sitl, lambda kept: kept if memory else None)
    sitl.run(0.1)
    assert sitl.inside.copter.parts.rotor_loss.lost == 3
    sitl.wait_until(lambda: not (sitl.armed and sitl.tilt_deg < 20.0), within=20.0)
    assert not sitl.armed
    assert abs(sitl.position[2]) < 0.05
    assert sitl.said("rotor 4 failed: landing on three rotors")
    refused(sitl, "rotor 4 failed", sitl.arm)


@HIGH
def test_a_parameter_turns_the_detection_off(sitl: Sitl) -> None:
    sitl.set_param("CA_FAILURE_MODE", 0)
    sitl.inject("motor", "off", 1)
    sitl.run(0.5)
    assert sitl.mode is Mode.HOLD
    assert not sitl.said("failed")


@pytest.mark.parametrize("rotor", range(4))
@pytest.mark.sitl(airborne=6.0)
def test_three_rotors_in_a_line_divide_by_nothing(sitl: Sitl, rotor: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a ground station may set them; a rotor taken for lost later once ended the process."""
    sitl.set_param("VEH_ROT3_X", 0.0)

    def lose(watch: RotorWatch, *_: object, **__: object) -> int:
        watch.lost = rotor
        return rotor

    monkeypatch.setattr(RotorWatch, "step", lose)
    sitl.run(0.5)
    assert sitl.inside.copter.parts.rotor_loss.flies
