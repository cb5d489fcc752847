"""Exceptions in flight where `python -m tools.chaos` throws none: on three rotors, at a restart, in what is served."""

from math import inf

import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.rotor_loss.detector import RotorWatch
from colibri.autopilot.core.copter import copter_autopilot
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.parameters.definitions import ImpossibleError
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.hil.faults import MOTOR, OFF
from colibri.mavlink.wire.dialect import mav
from colibri.plant.vehicle.description import load_vehicle
from tools.chaos.places import Thrower
from tools.harness.copter_flight import ACCEPTED, DENIED, FLIGHT, in_the_air

THREE = "autopilot.control.rotor_loss.three_rotors:ThreeRotors.step"


def test_the_law_on_three_rotors_may_raise_once() -> None:
    flight = in_the_air(6.0, strict=False)
    assert flight.inject(MOTOR, OFF, 1) == ACCEPTED
    flight.wait_until(lambda: flight.copter.parts.rotor_loss.flies, within=1.0)
    flight.run(1.0)
    thrower = Thrower(THREE, times=1.0)
    thrower.arm()
    try:
        flight.wait_until(lambda: not flight.armed, within=20.0)
    finally:
        thrower.disarm()
    assert abs(flight.position[2]) < 0.1
    assert flight.client.said("three rotors failed: last command stays")


@pytest.mark.parametrize("times", [1.0, inf])
def test_a_restart_that_raises_begins_anew(times: float) -> None:
    flight = in_the_air(5.0, strict=False)
    thrower = Thrower("autopilot.core.flight_start:FlightStart.begin", times)
    history = flight.history()
    thrower.arm()
    try:
        flight.restart(history)
        flight.run(2.0)
    finally:
        thrower.disarm()
    if times == 1.0:
        assert flight.mode is Mode.HOLD
        assert abs(flight.position[2] - 5.0) < 1.0
    assert flight.copter.defence.counts["restart"] == 1


def test_it_is_not_armed_again() -> None:
    flight = in_the_air(2.0, strict=False)
    thrower = Thrower("autopilot.control.loop:ControlLoop.decide", times=1.0)
    thrower.arm()
    flight.run(0.5)
    thrower.disarm()
    flight.land()
    assert flight.arm() == DENIED
    assert any("control law failed: restart the autopilot" in text for text in flight.client.texts)


def test_the_last_resort_lets_nothing_else_be_flown() -> None:
    flight = in_the_air(5.0, strict=False)
    thrower = Thrower("autopilot.commander.pilot:Pilot.step")
    thrower.arm()
    flight.run(0.2)
    thrower.disarm()
    assert flight.select(Mode.RETURN) == DENIED
    assert flight.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 21196.0) in (ACCEPTED, DENIED)
    flight.wait_until(lambda: not flight.rotors.armed, within=20.0)
    assert flight.arm(force=True) == DENIED


def test_a_place_that_strict_flights_raise_from() -> None:
    flight = in_the_air(5.0)
    thrower = Thrower("autopilot.ground.snapshots:SnapshotBuilder.take")
    thrower.arm()
    try:
        with pytest.raises(Exception, match="take"):
            flight.run(0.1)
    finally:
        thrower.disarm()


def test_values_that_cannot_be_flown_are_refused_at_the_start() -> None:
    settings = StationSettings(system_id=1, identity="px4", origin=DEFAULT_ORIGIN)
    vehicle = load_vehicle(FLIGHT.simulation.vehicle)
    with pytest.raises(ImpossibleError, match="hover needs"):
        copter_autopilot(FLIGHT, vehicle, settings, lambda: 0.0, values={"VEH_MASS": 50.0})


@pytest.mark.parametrize("rotor", range(4))
def test_three_rotors_in_a_line_divide_by_nothing(rotor: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a ground station may set them; a rotor taken for lost later once ended the process."""
    flight = in_the_air(6.0)
    flight.copter.parameters.set("VEH_ROT3_X", 0.0)
    flight.step()

    def lose(watch: RotorWatch, *_: object, **__: object) -> int:
        watch.lost = rotor
        return rotor

    monkeypatch.setattr(RotorWatch, "step", lose)
    flight.run(0.5)
    assert flight.copter.parts.rotor_loss.flies
