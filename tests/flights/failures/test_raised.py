"""Exceptions in flight where `python -m tools.chaos` throws none: on three rotors, at a restart, in what is served."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import inf

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.vehicle import FORCE, Sitl
from tests.support.flying import ACCEPTED, DENIED, QUICK, refused, restart
from tools.chaos import Thrower

pytestmark = QUICK

REPLACED = pytest.mark.sitl(airborne=5.0, strict=False)


@contextmanager
def thrown(place: str, times: float = inf) -> Iterator[None]:
    thrower = Thrower(place, times)
    thrower.arm()
    try:
        yield
    finally:
        thrower.disarm()


@REPLACED
def test_the_law_on_three_rotors_may_raise_once(sitl: Sitl) -> None:
    sitl.inject("motor", "off", 1)
    sitl.wait_until(lambda: sitl.inside.copter.parts.rotor_loss.flies, within=1.0)
    sitl.run(1.0)
    with thrown("autopilot.control.rotor_loss.three_rotors:ThreeRotors.step", times=1.0):
        sitl.wait_until(lambda: not sitl.armed, within=20.0)
    assert abs(sitl.position[2]) < 0.1
    assert sitl.said("three rotors failed: last command stays")


@pytest.mark.parametrize("times", [1.0, inf])
@REPLACED
def test_a_restart_that_raises_begins_anew(sitl: Sitl, times: float) -> None:
    sitl.run(0.1)
    with thrown("autopilot.core.flight_start:FlightStart.begin", times):
        restart(sitl)
        sitl.run(2.0)
    if times == 1.0:
        assert sitl.mode is Mode.HOLD
        assert abs(sitl.position[2] - 5.0) < 1.0
    assert sitl.inside.copter.defence.counts["restart"] == 1


@REPLACED
def test_after_an_exception_it_is_not_armed_again(sitl: Sitl) -> None:
    with thrown("autopilot.control.loop:ControlLoop.decide", times=1.0):
        sitl.run(0.5)
    sitl.land()
    refused(sitl, "control law failed: restart the autopilot", sitl.arm)


@REPLACED
def test_the_last_resort_lets_nothing_else_be_flown(sitl: Sitl) -> None:
    with thrown("autopilot.commander.pilot:Pilot.step"):
        sitl.run(0.2)
    refused(sitl, "", sitl.select, Mode.RETURN)
    assert sitl.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, FORCE) in (ACCEPTED, DENIED)
    sitl.wait_until(lambda: not sitl.rotors.armed, within=20.0)
    refused(sitl, "", sitl.arm, force=True)
