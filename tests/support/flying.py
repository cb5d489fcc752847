"""What tests of whole flights share: orders that are refused, orbits, streams of messages, restarts."""

import re
from collections.abc import Callable
from math import nan
from typing import Any

import pytest
from msgspec.structs import replace

from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.core.checkpoint import History
from colibri.autopilot.process.state_folder import StateFolder
from colibri.common.earth.geodesy import geodetic_of
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import mav
from colibri.sitl import mission_items as items
from colibri.sitl.vehicle import Sitl

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
DENIED: int = mav.MAV_RESULT_DENIED
UNSUPPORTED: int = mav.MAV_RESULT_UNSUPPORTED
SYSTEM, COMPONENT = 1, 1
RELATIVE: int = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
EVERY_S = 0.1
_FLIGHT = load_profile("flight")
QUICK = pytest.mark.sitl(profile=replace(_FLIGHT, simulation=replace(_FLIGHT.simulation, frame_interval_s=None)))
"""Flown with a frame for each control sample and none between: a fifth less to compute."""


def refused(sitl: Sitl, reason: str, order: Callable[..., object], *args: Any, **options: Any) -> None:
    """Give an order that is refused, with a text that has `reason` in it."""
    before = len(sitl.texts)
    with pytest.raises(sitl.Refused) as refusal:
        order(*args, **options)
    assert re.search(reason, f"{refusal.value} {sitl.texts[before:]}")


def in_mode(sitl: Sitl, mode: Mode) -> bool:
    """Whether it is in a mode now: after `sitl.mode is` a type checker takes it for the same ever after."""
    return sitl.mode is mode


def degrees_e7(sitl: Sitl, east_m: float, north_m: float) -> tuple[int, int]:
    place = geodetic_of((east_m, north_m, 0.0), sitl.origin)
    return round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)


def orbit(
    sitl: Sitl, radius_m: float, speed_m_s: float, *more: float, center: tuple[float, float] | None = None
) -> int:
    params = (radius_m, speed_m_s, *more, *(nan,) * (2 - len(more)))
    x, y = (NOT_GIVEN, NOT_GIVEN) if center is None else degrees_e7(sitl, *center)
    return sitl.gcs.order_int(mav.MAV_CMD_DO_ORBIT, *params, frame=RELATIVE, x=x, y=y, z=nan)


def stream(sitl: Sitl, seconds: float, send: Callable[[], object]) -> None:
    for _ in range(round(seconds / EVERY_S)):
        send()
        sitl.run(EVERY_S)


def latest(sitl: Sitl, name: str) -> Any:
    """Request a message and return it."""
    before, number = len(sitl.gcs.heard[name]), float(getattr(mav, f"MAVLINK_MSG_ID_{name}"))
    assert sitl.command(mav.MAV_CMD_REQUEST_MESSAGE, number) == ACCEPTED
    sitl.wait_until(lambda: len(sitl.gcs.heard[name]) > before, within=1.0, what=name)
    return sitl.gcs.latest(name)


def restart(sitl: Sitl, change: Callable[[History], History | None] = lambda kept: kept) -> None:
    """Kill the autopilot and start it again with a change of what was kept of the flight; None: with nothing."""
    kept = StateFolder.history
    with pytest.MonkeyPatch.context() as patch:

        def changed(folder: StateFolder) -> History | None:
            history = kept(folder)
            return None if history is None else change(history)

        patch.setattr(StateFolder, "history", changed)
        sitl.kill_autopilot()
    nobody, active = mav.MAV_AUTOPILOT_INVALID, mav.MAV_STATE_ACTIVE  # it knows of no ground station
    sitl.send("HEARTBEAT", mav.MAV_TYPE_GCS, nobody, 0, 0, active, 3)


def reached(sitl: Sitl) -> list[int]:
    return [fields.seq for fields in sitl.heard("MISSION_ITEM_REACHED")]


EVERY_KIND = (
    items.takeoff(2.0),
    items.change_speed(3.0),
    items.waypoint(3.0, 0.0, 2.0),
    items.Item(mav.MAV_CMD_NAV_LOITER_TIME, (0.5, 0.0, 0.0, nan), (3.0, 1.0, 2.0)),
    items.jump(3, 1),
    items.Item(mav.MAV_CMD_CONDITION_YAW, (90.0,)),
    items.Item(mav.MAV_CMD_NAV_DELAY, (0.5,)),
    items.Item(mav.MAV_CMD_IMAGE_START_CAPTURE),
    items.Item(mav.MAV_CMD_NAV_LOITER_TURNS, (1.0, 0.0, 1.5, nan), (3.0, 2.5, 2.0)),
    items.Item(mav.MAV_CMD_NAV_LOITER_TO_ALT, (0.0, 0.0, 0.0, nan), (2.0, 1.0, 3.0)),
    items.Item(mav.MAV_CMD_DO_SET_HOME, (0.0,), (0.0, 0.0, 0.0)),
    items.return_home(),
)
"""A mission with an item of every kind, from the ground to the ground."""
