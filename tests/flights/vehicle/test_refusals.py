"""Refusals: each comes with a STATUSTEXT, and an upload's names the item."""

from math import nan

import pytest

from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl
from tests.support.flying import ACCEPTED, QUICK

NAN = 2**31 - 1  # as a coordinate
UPLOADS = [
    ("upload_mission", items.Item(mav.MAV_CMD_NAV_SPLINE_WAYPOINT, (), (1.0, 0.0, 4.0)), "mission item 1: NAV_SPLINE"),
    ("upload_mission", MissionItem(3, mav.MAV_CMD_NAV_WAYPOINT, 1, 0, 0, 0, 0, 0, 0, 5.0), "latitude 0, longitude 0"),
    ("upload_mission", MissionItem(3, mav.MAV_CMD_NAV_WAYPOINT, 1, 0, 0, 0, 0, NAN, NAN, 5.0), "latitude nan"),
    ("upload_mission", items.jump(7, 1), "mission item 1: DO_JUMP (177): parameter 1 is 7"),
    ("upload_rally", items.waypoint(1.0, 0.0, 5.0), "rally item 1: NAV_WAYPOINT (16) is not supported"),
    ("upload_fence", items.circle(-3.0)[0], "parameter 1 is -3"),
]


@QUICK
@pytest.mark.parametrize("value", [7.0, nan])
def test_every_refused_command_is_named(sitl: Sitl, value: float) -> None:
    sitl.takeoff(2.0)
    silent = []
    for number in sorted(mav.enums["MAV_CMD"]):
        before = len(sitl.texts)
        result = sitl.command(number, *[value] * 7)
        sitl.run(0.005)
        if result != ACCEPTED and not any(sitl.texts[before:]):
            silent.append((number, result))
    assert not silent


@QUICK
@pytest.mark.parametrize(("upload", "item", "words"), UPLOADS)
def test_a_refused_item_is_named(sitl: Sitl, upload: str, item: items.Item | MissionItem, words: str) -> None:
    first = {
        "upload_mission": items.takeoff(4.0),
        "upload_fence": items.circle(9.0)[0],
        "upload_rally": items.Item(mav.MAV_CMD_NAV_RALLY_POINT, (), (1.0, 0.0, 5.0)),
    }[upload]
    with pytest.raises(sitl.Refused):
        getattr(sitl, upload)([first, item])
    sitl.run(0.1)
    assert any(words in text for text in sitl.texts)
