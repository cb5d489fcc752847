"""The page of latencies: how a flight is judged, and what the page then says."""

import numpy as np
import pytest

from colibri.analysis.recording import COLUMNS, Recording
from tools.pages.latency import STEP, Merit, Point, fly, merit, page

GOOD, BAD = Merit(0.001, 0.0, 40.0), Merit(0.4, 0.1, 70.0)


def recording(x: float = 0.0, phi: float = 0.0, until_s: float = STEP.duration_s) -> Recording:
    """Return a flight that ends as it is told to."""
    table = np.zeros((100, len(COLUMNS)))
    table[:, COLUMNS.index("t")] = np.linspace(0.0, until_s, 100)
    table[50, COLUMNS.index("x")] = x
    table[90:, COLUMNS.index("phi")] = phi
    none = np.zeros(99)
    counts = none.astype(np.int64)
    return Recording(table, counts, counts, none, none, none, np.zeros((99, 4), np.int64), "")


def test_a_flight_that_is_off_or_ends_early_or_upside_down_is_lost() -> None:
    assert merit(recording(), STEP) == Merit(0.0, 0.0, 0.0)
    for lost in (recording(x=6.0), recording(phi=2.0), recording(until_s=3.0)):
        assert merit(lost, STEP) is None


def test_overshoot_is_how_far_it_goes_past() -> None:
    went = merit(recording(x=-0.25), STEP)
    assert went is not None
    assert went.overshoot_m == pytest.approx(0.25)


def test_the_page_says_up_to_where_it_flies() -> None:
    text = page([Point(0, GOOD, GOOD), Point(8, GOOD, GOOD), Point(16, BAD, None), Point(24, None, None)])
    assert "to within 2 cm up to a round trip of 8 ms" in text
    assert "up to 16 ms in hover, and 8 ms on the lemniscate" in text
    assert text.count("| lost |") > 0


def test_a_round_trip_within_a_control_sample_is_flown() -> None:
    went = fly(STEP._replace(duration_s=4.0, judged_from_s=3.5), 6.0)
    assert went is not None
    assert went.rms_m < 0.01
    assert 30.0 < went.tilt_deg < 60.0
