"""How the plant keeps time."""

from math import inf

import pytest

from colibri.plant.process.server import FramePacer


@pytest.mark.parametrize(
    ("speed", "asked"),
    [
        (2.0, [(0, 10.0, 10.0), (4_000, 10.0, 10.002), (1_000_000, 10.0, 10.5)]),
        (1.0, [(1_000_000, 11.09, 11.0), (1_004_000, 11.09, 11.004)]),
        (1.0, [(1_000_000, 31.0, 30.9), (1_200_000, 31.0, 31.1)]),
    ],
    ids=["by the wall clock", "a moment is caught up", "a long pause is not caught up"],
)
def test_when_frames_are_due(speed: float, asked: list[tuple[int, float, float]]) -> None:
    pace = FramePacer(speed, 10.0)
    for time_us, now_s, due_s in asked:
        assert pace.due_s(time_us, now_s) == pytest.approx(due_s)


def test_flat_out_every_frame_is_due_at_once() -> None:
    pace = FramePacer(inf, 10.0)
    assert pace.due_s(0, 10.0) <= 10.0
    assert pace.due_s(1_000_000, 500.0) <= 500.0
    assert pace.due_s(2_000_000, 500.001) <= 500.001
