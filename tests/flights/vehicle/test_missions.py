"""Missions and tracks flown: every kind of item, jumps and delays, pausing, going elsewhere in between, the end."""

from math import dist, hypot, nan
from pathlib import Path

import numpy as np
import pytest

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.guidance.trajectories.registry import track
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED, EVERY_KIND, QUICK, in_mode, reached

pytestmark = [QUICK, pytest.mark.sitl(airborne=3.0)]


@pytest.mark.sitl(airborne=None, params={"RTL_RETURN_ALT": 3.0, "COM_DISARM_LAND": 0.1})
def test_every_kind_of_item_from_ground_to_ground(sitl: Sitl) -> None:
    sitl.upload_mission(EVERY_KIND)
    assert sitl.command(mav.MAV_CMD_MISSION_START) == ACCEPTED
    sitl.arm()
    sitl.wait_until(lambda: not sitl.armed, within=60.0)
    assert reached(sitl) == [0, 1, 2, 3, 4, 3, 4, 5, 6, 7, 8, 9, 10, 11]
    assert sitl.said("mission says return: return")
    assert hypot(*sitl.position[:2]) < 0.15
    assert np.linalg.norm(sitl.path - (3.0, 1.0, 2.0), axis=1).min() < 0.1
    around = sitl.path[:, :2] - (3.0, 2.5)
    around = around[abs(np.hypot(*around.T) - 1.5) < 0.15]
    assert len({(x > 0.0, y > 0.0) for x, y in around}) == 4
    sitl.run(0.02)
    assert sitl.gcs.latest("MISSION_CURRENT").mission_state == mav.MISSION_STATE_COMPLETE


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
