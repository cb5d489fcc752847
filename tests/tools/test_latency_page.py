"""The page of latencies: how a flight is judged, and what the page then says."""

import numpy as np
import pytest

from colibri.analysis.recording import COLUMNS, Recording
from tools.pages.latency import LAWS, LEMNISCATE, STEP, WAYS, SweepPoint, fly, merit, tables

GOOD, BAD = 0.001, 0.4


def recording(x: float = 0.0, phi: float = 0.0, until_s: float = STEP.duration_s) -> Recording:
    table = np.zeros((100, len(COLUMNS)))
    table[:, COLUMNS.index("t")] = np.linspace(0.0, until_s, 100)
    table[50, COLUMNS.index("x")] = x
    table[90:, COLUMNS.index("phi")] = phi
    none = np.zeros(99)
    counts = none.astype(np.int64)
    return Recording(table, counts, counts, none, none, none, np.zeros((99, 4), np.int64), none, None, "")


def test_flights_off_track_early_or_inverted_are_lost() -> None:
    assert merit(recording(), STEP) == 0.0
    for lost in (recording(x=6.0), recording(phi=2.0), recording(until_s=3.0)):
        assert merit(lost, STEP) is None


def test_the_page_says_up_to_where_it_flies() -> None:
    flown: dict[float, tuple[float, float | None]] = {0: (GOOD, GOOD), 8: (BAD, GOOD), 16: (GOOD, None)}
    points = [SweepPoint(law, way, ms, *flown[ms]) for law in LAWS for way in WAYS for ms in flown]
    text = "".join(tables(points))
    assert text.count("| 0 ms | 8 ms |") == len(LAWS) * len(WAYS)
    assert text.count("| lost |") > 0


@pytest.mark.parametrize("law", LAWS)
def test_only_compensation_survives_a_long_round_trip(law: str) -> None:
    case = LEMNISCATE._replace(duration_s=4.0, judged_from_s=3.0)
    at_once, late = fly(law, case, 0.0, None), fly(law, case, 40.0, None)
    assert at_once is not None
    assert late is not None
    assert late < 1.5 * at_once
    assert fly(law, case, 40.0, 0.0) is None
