"""The first flights of the fixture: up, there, back down; in wind; on sensors."""

from collections.abc import Callable

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.sitl.ground_station import RefusedError
from colibri.sitl.vehicle import Sitl


def test_up_there_and_down(sitl: Sitl) -> None:
    sitl.takeoff(3.0)
    sitl.goto(2.0, 1.0, 4.0)
    sitl.hold(lambda: sitl.is_at((2.0, 1.0, 4.0)), for_=2.0)
    sitl.land()
    assert sitl.position == pytest.approx((2.0, 1.0, 0.0), abs=0.1)


@pytest.mark.sitl(airborne=3.0)
@pytest.mark.seeds(1, 2)
@pytest.mark.wind("4@270", turbulence="light")
def test_holds_its_place_in_wind(sitl: Sitl) -> None:
    assert sitl.mode is Mode.HOLD
    sitl.run(2.0)
    sitl.hold(lambda: sitl.is_at((0.0, 0.0, 3.0), near_m=0.5, slow_m_s=1.0), for_=3.0)


def test_no_mission_is_refused(sitl: Sitl) -> None:
    with pytest.raises(RefusedError, match="there is no mission"):
        sitl.start_mission()


@pytest.mark.feedback("sensors")
def test_takes_off_on_sensors(sitl: Sitl) -> None:
    sitl.takeoff(3.0)
    assert sitl.position[2] == pytest.approx(3.0, abs=1.0)


@pytest.mark.sitl(airborne=3.0)
def test_a_bad_link_to_the_plant_changes_nothing(sitl: Sitl, sitl_fleet: Callable[..., list[Sitl]]) -> None:
    (other,) = sitl_fleet(1, system=1)
    bad = other.link.plant
    bad.loss, bad.duplicate, bad.reorder, bad.corrupt, bad.jitter_s = 0.2, 0.1, 0.1, 0.1, 0.004
    for flight in (sitl, other):
        flight.goto(1.0, 0.0, 3.0)
    assert other.sha256 == sitl.sha256
