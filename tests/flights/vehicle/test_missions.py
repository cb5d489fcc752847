"""Missions and tracks flown: how they begin, and their end."""

from math import dist, nan
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.support.flying import QUICK, in_mode

pytestmark = [QUICK, pytest.mark.sitl(airborne=3.0)]


def test_a_mission_that_ends_on_a_circle_ends_at_rest(sitl: Sitl) -> None:
    turns = items.Item(mav.MAV_CMD_NAV_LOITER_TURNS, (0.5, 0.0, 1.5, nan), (1.5, 0.0, 3.0))
    sitl.upload_mission([turns])
    sitl.select(Mode.MISSION)
    sitl.wait_until(lambda: sitl.mode is Mode.HOLD, within=10.0)
    sitl.run(2.5)
    assert sitl.speed_m_s < 0.1


@pytest.mark.sitl(airborne=None)
def test_a_track_is_flown_from_the_ground(sitl: Sitl) -> None:
    sitl.fly_track("line")
    sitl.run(7.0)
    dragged = (sitl.path[:, 2] < 0.5) & (np.hypot(*sitl.path[:, :2].T) > 0.05)
    assert not dragged.any()
    assert sitl.mode is Mode.TRACK
    assert dist(sitl.position, position(track("line"), np.zeros(1))[0]) < 1.0
    assert sitl.velocity[:2] == pytest.approx((0.1, 0.1), abs=0.05)


@pytest.mark.sitl(airborne=2.0, track=f"waypoints:{Path(__file__).parent / 'short.csv'}")
def test_a_track_from_time_0_ends_in_hold(sitl: Sitl) -> None:
    sitl.run(1.5)
    assert sitl.mode is Mode.TRACK
    sitl.run(2.5)
    assert in_mode(sitl, Mode.HOLD)
    sitl.run(2.0)
    assert sitl.speed_m_s < 0.1
