"""A ground station that has a mission flown, whatever restarts."""

from collections.abc import Sequence
from math import nan
from time import monotonic

from colibri.autopilot.commander.rules.modes import Mode, mode_of_custom
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.commands import Command
from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.client.plans import Upload
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, MODE_ARMED, Message, mav
from colibri.sitl.mission_items import Item
from tools.harness.ports import bound_socket

_VEHICLE = (1, AUTOPILOT_COMPONENT)
_MAX_DATAGRAM_BYTES = 65536
HOVER_S = 6.0
HEIGHT_M = 6.0
_PLACES = ((22.0, 0.0), (22.0, 18.0), (0.0, 18.0), (0.0, 0.0))


LEGS = len(_PLACES)


def mission(legs: int = LEGS) -> list[MissionItem]:
    items = [_item(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0)]
    for east, north in _PLACES[:legs]:
        items.append(_item(mav.MAV_CMD_NAV_WAYPOINT, east, north))
        items.append(_item(mav.MAV_CMD_NAV_LOITER_TIME, east, north, HOVER_S))
    return [*items, _item(mav.MAV_CMD_NAV_LAND, *_PLACES[legs - 1])]


HOVERS = frozenset(range(2, 2 * len(_PLACES) + 1, 2))
"""Items of the mission with a hover."""


class KillStation:
    """A ground station on a port of this computer."""

    def __init__(self, items: Sequence[MissionItem]) -> None:
        self.socket, self.url = bound_socket()
        self.socket.setblocking(False)
        self._items = items
        self.begin_anew()

    def begin_anew(self) -> None:
        self.mode: Mode | None = None
        self.armed: bool | None = None
        self.seq = 0
        self.flown = self.has_armed = False
        self._inbox = Inbox()
        self._client = Client(255, mav.MAV_COMP_ID_MISSIONPLANNER, only=_VEHICLE[0])
        self._upload: Upload | None = None
        self._under_way: Conversation | None = None

    @property
    def texts(self) -> list[str]:
        return self._inbox.texts

    def receive(self) -> None:
        now_us = round(monotonic() * 1e6)
        while True:
            try:
                datagram, vehicle = self.socket.recvfrom(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            for message in self._client.receive(datagram, now_us):
                self._take(message)
            for answer in self._client.poll(now_us):
                self.socket.sendto(answer, vehicle)

    def drain(self) -> None:
        while True:
            try:
                self.socket.recv(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return

    def close(self) -> None:
        self.socket.close()

    def _take(self, message: Message) -> None:
        fields = message.fields
        match message.name:
            case "HEARTBEAT":
                self._see(mode_of_custom(fields.custom_mode), bool(fields.base_mode & MODE_ARMED))
            case "STATUSTEXT":
                self._inbox.add(message)
            case "MISSION_CURRENT":
                self.seq = fields.seq

    def _see(self, mode: Mode | None, armed: bool) -> None:
        """Begin the next outstanding request, until the rotors are armed."""
        self.mode, self.armed = mode, armed
        self.flown = self.flown or (self.has_armed and not armed)
        self.has_armed = self.has_armed or armed
        if self.has_armed or (self._under_way is not None and self._under_way.result is None):
            return
        if self._upload is None or not self._upload.accepted:
            self._under_way = self._upload = self._client.begin(Upload(_VEHICLE, self._items))
        elif mode is not Mode.MISSION:
            self._under_way = self._client.begin(Command(_VEHICLE, mav.MAV_CMD_MISSION_START))
        else:
            self._under_way = self._client.begin(Command(_VEHICLE, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0))


def _item(command: int, east: float, north: float, p1: float = 0.0) -> MissionItem:
    up = 0.0 if command == mav.MAV_CMD_NAV_LAND else HEIGHT_M
    return Item(command, (p1, 0.0, 0.0, nan), (east, north, up)).on_wire(DEFAULT_ORIGIN)
