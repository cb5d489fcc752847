"""Clients do not wait between what a mode needs and the mode: both may come between two control samples."""

from math import nan

import pytest

from colibri.autopilot.commander.rules.modes import Mode, custom_mode
from colibri.mavlink.wire.dialect import mav
from tools.harness.client import COMPONENT, SYSTEM
from tools.harness.copter_flight import CopterFlight

POSITION_ONLY = 0x9F8


def _ask_for(flown: CopterFlight, mode: Mode) -> None:
    number = custom_mode(mode)
    main, sub = number >> 16 & 0xFF, number >> 24 & 0xFF
    command = (mav.MAV_CMD_DO_SET_MODE, 0, mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub, nan, nan, nan, nan)
    flown.send("COMMAND_LONG", SYSTEM, COMPONENT, *command)


@pytest.mark.parametrize("mode", [Mode.OFFBOARD, Mode.POSITION])
def test_the_mode_is_taken_with_the_first_message_that_it_needs(mode: Mode) -> None:
    flown = CopterFlight()
    flown.takeoff()
    if mode is Mode.OFFBOARD:
        place = (0.0, 0.0, -2.5)
        still = (0.0,) * 8
        flown.send("SET_POSITION_TARGET_LOCAL_NED", 0, SYSTEM, COMPONENT, 1, POSITION_ONLY, *place, *still)
    else:
        flown.send("MANUAL_CONTROL", SYSTEM, 0, 0, 500, 0, 0)
    _ask_for(flown, mode)
    flown.run(0.1)
    assert flown.client.acks[-1].result == mav.MAV_RESULT_ACCEPTED
    assert flown.mode is mode


def test_without_it_the_mode_is_refused() -> None:
    flown = CopterFlight()
    flown.takeoff()
    assert flown.select(Mode.OFFBOARD) == mav.MAV_RESULT_DENIED
    assert flown.select(Mode.POSITION) == mav.MAV_RESULT_DENIED
