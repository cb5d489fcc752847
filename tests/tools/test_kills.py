"""A few of each that `make kills` has hundreds of: processes killed in flight over UDP."""

from pathlib import Path

import pytest

from colibri.mavlink.hil.feedback import Feedback
from tools.kills.__main__ import failures_of, fly_autopilots, fly_plants


@pytest.mark.long
@pytest.mark.parametrize("feedback", list(Feedback))
def test_autopilots_killed_in_a_mission(tmp_path: Path, feedback: Feedback) -> None:
    flight = fly_autopilots(tmp_path / "flight", feedback, seed=4, max_kills=2, legs=1)
    assert failures_of(1, flight) == []
    assert len(flight.kills) == 2
    assert max(kill.tilt_deg for kill in flight.kills) < 45.0


@pytest.mark.long
def test_plants_killed_in_a_mission(tmp_path: Path) -> None:
    kills, words = fly_plants(tmp_path / "flight", Feedback.STATE, seed=1, kills=2)
    assert words == ""
    assert all(kill.stood for kill in kills)
    assert all("waiting for a plant" in kill.said for kill in kills if kill.said)
