"""How the plant keeps time."""

from math import inf

import pytest

from colibri.plant.process.server import Pace


def test_frames_are_due_by_the_wall_clock() -> None:
    pace = Pace(2.0, 10.0)
    assert [pace.due_s(time_us, 10.0) for time_us in (0, 4_000, 1_000_000)] == [10.0, 10.002, 10.5]


def test_a_moment_is_caught_up() -> None:
    pace = Pace(1.0, 10.0)
    assert pace.due_s(1_000_000, 11.09) == 11.0
    assert pace.due_s(1_004_000, 11.09) == pytest.approx(11.004)


def test_what_held_the_flight_up_for_long_is_not_caught_up() -> None:
    pace = Pace(1.0, 10.0)
    assert pace.due_s(1_000_000, 31.0) == pytest.approx(30.9)
    assert pace.due_s(1_200_000, 31.0) == pytest.approx(31.1)


def test_flat_out_every_frame_is_due_at_once() -> None:
    pace = Pace(inf, 10.0)
    assert pace.due_s(0, 10.0) <= 10.0
    assert pace.due_s(1_000_000, 500.0) <= 500.0
    assert pace.due_s(2_000_000, 500.001) <= 500.001
