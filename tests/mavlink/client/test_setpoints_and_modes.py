"""Setpoints as the vehicle's own readers understand them, and modes by name and number."""

from math import nan, pi

import pytest

from colibri.mavlink.client.modes import ARDUPILOT, PX4, mode_name, mode_named
from colibri.mavlink.client.setpoints import attitude_target, manual_control, position_target
from colibri.mavlink.wire.dialect import Codec, mav

TARGET = (1, 1)


def test_a_position_target_on_the_wire() -> None:
    name, fields = position_target(TARGET, (1.0, 2.0, 3.0), yaw=0.0, time_us=5_000)
    (message,) = Codec(0, 0).decode(Codec(255, 190).encode(name, *fields))
    sent = message.fields
    assert (sent.time_boot_ms, sent.coordinate_frame) == (5, mav.MAV_FRAME_LOCAL_NED)
    assert (sent.x, sent.y, sent.z, sent.yaw) == pytest.approx((2.0, 1.0, -3.0, pi / 2.0))
    assert sent.type_mask == 0b1001_1111_1000


def test_velocity_and_acceleration_are_masked_by_group() -> None:
    _, fields = position_target(TARGET, velocity=(1.0, 0.0, 0.0), yaw_rate=0.5)
    assert fields[4] == 0b0101_1100_0111
    assert fields[-1] == -0.5
    _, fields = position_target(TARGET, acceleration=(0.0, 0.0, 1.0))
    assert fields[4] == 0b1100_0011_1111


def test_an_attitude_target_is_an_attitude_or_rates() -> None:
    _, fields = attitude_target(TARGET, rates=(0.1, 0.2, 0.3), thrust=0.6)
    assert fields[3:] == (128, (1.0, 0.0, 0.0, 0.0), 0.1, -0.2, -0.3, 0.6)
    _, fields = attitude_target(TARGET, (1.0, 0.0, 0.0, 0.0), thrust=nan)
    assert fields[3] == 0b111
    assert fields[4] == pytest.approx((0.5**0.5, 0.0, 0.0, 0.5**0.5))


def test_sticks_on_the_wire() -> None:
    assert manual_control(3, pitch=0.5, yaw=-1.0) == ("MANUAL_CONTROL", (3, 500, 0, 500, -1000, 0))


@pytest.mark.parametrize(("autopilot", "name"), [(PX4, "Hold"), (PX4, "Return"), (ARDUPILOT, "RTL")])
def test_modes_are_set_as_they_are_read(autopilot: int, name: str) -> None:
    mode = mode_named(autopilot, name)
    assert mode is not None
    assert mode_name(autopilot, mode.custom) == name
    _, main, sub = map(int, mode.command)
    assert mode.custom == (main << 16 | sub << 24 if autopilot == PX4 else main)


def test_modes_of_an_unknown_autopilot() -> None:
    assert mode_named(mav.MAV_AUTOPILOT_GENERIC, "Hold") is None
    assert mode_name(mav.MAV_AUTOPILOT_GENERIC, 7) == "mode 7"
