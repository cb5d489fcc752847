"""A vehicle that falls is taken for one that was in the air, and nothing else is."""

from math import pi

import pytest

from colibri.autopilot.estimation.sensing.free_fall import Caught, Falling
from colibri.autopilot.estimation.sensing.inertial import InertialReading
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler
from colibri.common.types import Vector
from colibri.mavlink.hil.sensors import GpsFix

G = 9.81
DELAY_US = 120_000
FRAME_US, FIX_US = 4_000, 100_000
NORTH: Vector = (0.0, 0.22, -0.42)
NOTHING_FELT: Vector = (0.01, 0.0, 0.05)


def watched(first_us: int, force: Vector, sink_m_s: float = 0.0, fixes: bool = True) -> tuple[int, Caught] | None:
    """Watch a vehicle for two seconds that feels `force` and sinks; return when it was caught, and how."""
    falling = Falling(G, NORTH, DELAY_US * 1e-6)
    for time_us in range(first_us, first_us + 2_000_000, FRAME_US):
        fell_s = max(0, time_us - DELAY_US - first_us) * 1e-6
        down = sink_m_s + (G * fell_s if force is NOTHING_FELT else 0.0)
        fix = GpsFix(time_us, 3, DEFAULT_ORIGIN, (2.0, 0.0, -down), 1.0, 1.0, 10)
        reading = InertialReading(force, (0.0, 0.0, 0.0), True, True)
        is_due = fixes and time_us % FIX_US == 0
        caught = falling.feed(time_us, reading, (0.22, 0.0, -0.42), 100.0, fix if is_due else None)
        if caught is not None:
            return time_us - first_us, caught
    return None


def test_a_fall_is_seen_within_three_tenths_of_a_second() -> None:
    found = watched(7_000_000, NOTHING_FELT)
    assert found is not None
    after_us, caught = found
    assert after_us <= 300_000
    velocity, fallen_m = -G * after_us * 1e-6, 0.5 * G * (after_us * 1e-6) ** 2
    assert caught.velocity_enu_m_s == pytest.approx((2.0, 0.0, velocity), abs=0.05)
    assert caught.moved_m[0] == pytest.approx(2.0 * DELAY_US * 1e-6)
    assert 0.0 < -caught.moved_m[2] < fallen_m
    assert euler_from_quaternion(caught.attitude) == pytest.approx((0.0, 0.0, pi / 2), abs=1e-6)
    assert caught.attitude == pytest.approx(quaternion_from_euler(0.0, 0.0, pi / 2), abs=1e-6)


def test_one_that_was_rising_is_caught_later() -> None:
    found = watched(7_000_000, NOTHING_FELT, sink_m_s=-5.0)
    assert found is not None
    assert 400_000 <= found[0] <= 500_000


@pytest.mark.parametrize("force", [(0.0, 0.0, G), (0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 0.0, -G)])
def test_what_feels_something_or_nothing_at_all_does_not_fall(force: Vector) -> None:
    """Nothing at all is what a sensor says that does not work."""
    assert watched(7_000_000, force, sink_m_s=1.0) is None


def test_without_gps_nothing_is_caught() -> None:
    assert watched(7_000_000, NOTHING_FELT, fixes=False) is None


def test_a_flight_that_begins_is_not_one_that_goes_on() -> None:
    assert watched(0, NOTHING_FELT) is None
