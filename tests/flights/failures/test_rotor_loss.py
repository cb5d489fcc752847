"""A rotor is lost in flight: the vehicle says so, gives up yaw, stays upright and lands; whatever flew it before."""

from math import dist, hypot
from typing import NamedTuple

import pytest
from msgspec import structs

from colibri.autopilot.commander.rules.modes import Mode
from colibri.common import rotations
from colibri.mavlink.hil.faults import MOTOR, OFF, WRONG
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.wire.dialect import mav
from colibri.plant.physics.world import state_frame
from tools.harness.copter_flight import ACCEPTED, DENIED, FLIGHT, CopterFlight, in_the_air

HEIGHT_M = 10.0
NEXT_TO_NONE = 0.001
"""Part of the thrust that is left of a rotor without its blades: it is gone at once, which is the worst that can be."""


class Fall(NamedTuple):
    """What became of a vehicle after it had lost a rotor.

    Attributes:
        noticed_s: After so long it said so.
        peak_deg: Largest tilt of the thrust from the vertical.
        settled_deg: The same from 1 s after the loss to the ground.
        landed_m: Horizontal distance from where the rotor was lost.
        sank_m_s: Fastest sinking in the last half metre.
        rest_deg: Tilt in the end.
        spin_rad_s: Fastest turn about the body's z axis.
    """

    noticed_s: float
    peak_deg: float
    settled_deg: float
    landed_m: float
    sank_m_s: float
    rest_deg: float
    spin_rad_s: float


def tilt_deg(flight: CopterFlight) -> float:
    return rotations.tilt_deg(state_frame(flight.world).attitude)


def fall(flight: CopterFlight, rotor: int) -> Fall:
    """Take a rotor away, and fly until the others have stopped and the vehicle rests."""
    place, began_s = flight.position, flight.time_s
    assert flight.inject(MOTOR, WRONG, rotor + 1, NEXT_TO_NONE) == ACCEPTED
    tilts: list[tuple[float, float]] = []
    sank_m_s = spin_rad_s = noticed_s = 0.0
    while flight.armed:
        assert flight.time_s < began_s + 30.0, "it must come down"
        flight.step()
        since_s = flight.time_s - began_s
        tilts.append((since_s, tilt_deg(flight)))
        spin_rad_s = max(spin_rad_s, abs(flight.world.state[5]))
        if flight.position[2] < 0.5:
            sank_m_s = max(sank_m_s, -flight.velocity[2])
        if not noticed_s and flight.copter.parts.rotor_loss.lost is not None:
            noticed_s = since_s
    in_air = [tilt for _, tilt in tilts]
    settled = [tilt for since_s, tilt in tilts if since_s > 1.0]
    landed_m = dist(flight.position[:2], place[:2])
    flight.run(1.0)
    return Fall(noticed_s, max(in_air), max(settled), landed_m, sank_m_s, tilt_deg(flight), spin_rad_s)


def check(fallen: Fall) -> None:
    assert 0.0 < fallen.noticed_s <= 0.05
    assert fallen.peak_deg < 35.0
    assert fallen.settled_deg < 20.0
    assert fallen.landed_m < 2.0
    assert fallen.sank_m_s < 1.2
    assert fallen.rest_deg < 1.0
    assert fallen.spin_rad_s < 30.0


@pytest.mark.parametrize("rotor", [0, *(pytest.param(rotor, marks=pytest.mark.long) for rotor in range(1, 4))])
def test_it_lands_upright_on_three_rotors(rotor: int) -> None:
    flight = in_the_air(HEIGHT_M)
    flight.run(0.4)
    check(fall(flight, rotor))
    assert flight.client.said(f"rotor {rotor + 1} failed: landing on three rotors")
    assert flight.client.said("landed, rotors stopped")


def test_it_lands_on_sensors() -> None:
    flight = CopterFlight(feedback=Feedback.SENSORS, seed=3)
    flight.takeoff(HEIGHT_M)
    check(fall(flight, 3))


def test_any_control_law_may_have_flown_before() -> None:
    profile = structs.replace(FLIGHT, controller="geometric-se3")
    flight = in_the_air(HEIGHT_M, profile=profile)
    flight.run(0.4)
    check(fall(flight, 2))


def test_nothing_but_landing_is_possible_any_more() -> None:
    flight = in_the_air(4.0)
    flight.run(0.4)
    assert flight.inject(MOTOR, OFF, 2) == ACCEPTED
    flight.run(0.5)
    assert flight.mode is Mode.LAND
    assert flight.client.latest("HEARTBEAT").system_status == mav.MAV_STATE_EMERGENCY
    assert flight.select(Mode.HOLD) == DENIED
    assert flight.client.said("hold refused: rotor 2 failed")
    flight.wait_until(lambda: not flight.armed, within=20.0, what="the landing")
    assert flight.arm() == DENIED
    assert flight.client.said("not armed: rotor 2 failed")
    assert flight.arm(force=True) == DENIED
    flight.set_param("CA_FAILURE_MODE", 0)
    flight.set_param("CA_FAILURE_MODE", 1)
    assert flight.arm() == ACCEPTED


def test_it_is_lost_at_speed_and_stops() -> None:
    flight = in_the_air(HEIGHT_M)
    assert flight.goto(100.0, 0.0, HEIGHT_M, speed=5.0) == ACCEPTED
    flight.run(4.0)
    assert hypot(*flight.velocity) > 4.5
    fallen = fall(flight, 0)
    assert fallen.settled_deg < 25.0
    assert fallen.rest_deg < 1.0
    assert fallen.sank_m_s < 1.2


def test_an_autopilot_that_is_restarted_in_the_spin_notices_anew() -> None:
    flight = in_the_air(6.0)
    flight.run(0.4)
    assert flight.inject(MOTOR, OFF, 4) == ACCEPTED
    flight.run(2.5)
    flight.restart()
    flight.run(0.1)
    assert flight.copter.parts.rotor_loss.lost == 3
    steepest_deg = 0.0
    while flight.armed:
        flight.step()
        steepest_deg = max(steepest_deg, tilt_deg(flight))
    assert steepest_deg < 20.0
    assert abs(flight.position[2]) < 0.05


def test_a_weak_rotor_is_flown_on_and_a_parameter_turns_all_off() -> None:
    flight = in_the_air(HEIGHT_M)
    assert flight.inject(MOTOR, WRONG, 1, 0.65) == ACCEPTED
    flight.run(3.0)
    assert flight.mode is Mode.HOLD
    assert flight.position[2] == pytest.approx(HEIGHT_M, abs=0.5)
    assert flight.copter.parts.rotor_loss.watch.max_evidence == 0.0
    flight.set_param("CA_FAILURE_MODE", 0)
    assert flight.inject(MOTOR, OFF, 1) == ACCEPTED
    flight.run(0.5)
    assert flight.mode is Mode.HOLD
    assert not flight.client.said("failed")
