"""A ground station that has a mission flown: says everything again until it is done, whoever answers."""

import socket
from collections.abc import Sequence
from math import nan
from typing import Any

from colibri.autopilot.commander.rules.modes import Mode, mode_of_custom
from colibri.common.earth.geodesy import DEFAULT_ORIGIN, geodetic_of
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.mission.items import MISSION, MissionItem, item_fields
from colibri.mavlink.node.service import Peer
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, MODE_ARMED, Codec, Message, mav

_VEHICLE = Peer(0, 1, AUTOPILOT_COMPONENT)
_MAX_DATAGRAM_BYTES = 65536
HOVER_S = 6.0
HEIGHT_M = 6.0
_PLACES = ((22.0, 0.0), (22.0, 18.0), (0.0, 18.0), (0.0, 0.0))


LEGS = len(_PLACES)


def mission(legs: int = LEGS) -> list[MissionItem]:
    """Return a take-off, up to four legs with a hover at the end of each, and a landing where the last ends."""
    items = [_item(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0)]
    for east, north in _PLACES[:legs]:
        items.append(_item(mav.MAV_CMD_NAV_WAYPOINT, east, north))
        items.append(_item(mav.MAV_CMD_NAV_LOITER_TIME, east, north, HOVER_S))
    return [*items, _item(mav.MAV_CMD_NAV_LAND, *_PLACES[legs - 1])]


HOVERS = frozenset(range(2, 2 * len(_PLACES) + 1, 2))
"""Items of the mission in which the vehicle hovers, once it is there."""


class Station:
    """Listens on a port of this computer.

    Attributes:
        url: The link that the vehicle is to serve.
        mode, armed: As the vehicle says; None before it has.
        seq: The current item.
        flown: Whether the mission was begun and is over, the rotors at rest.
    """

    def __init__(self, items: Sequence[MissionItem]) -> None:
        """Have `items` flown."""
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4_000_000)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.url = f"udpout:127.0.0.1:{self.socket.getsockname()[1]}"
        self._items = items
        self._words = Inbox()
        self._codec = Codec(255, mav.MAV_COMP_ID_MISSIONPLANNER)
        self.begin_anew()

    def begin_anew(self) -> None:
        """Expect another flight, of a vehicle that knows nothing."""
        self.mode: Mode | None = None
        self.armed: bool | None = None
        self.seq = 0
        self._words.forget()
        self.flown = self.has_armed = self._has_mission = False
        self._vehicle: tuple[str, int] | None = None

    @property
    def texts(self) -> list[str]:
        """What it said, line by line."""
        return self._words.texts

    def receive(self) -> None:
        """Take in what has come, and answer it."""
        while True:
            try:
                datagram, self._vehicle = self.socket.recvfrom(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            for message in self._codec.decode(datagram):
                if message.source == (_VEHICLE.system, _VEHICLE.component):
                    self._take(message)

    def drain(self) -> None:
        """Forget what has come and was not read."""
        while True:
            try:
                self.socket.recv(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return

    def close(self) -> None:
        """Listen no more."""
        self.socket.close()

    def _take(self, message: Message) -> None:
        fields = message.fields
        match message.name:
            case "HEARTBEAT":
                self._see(mode_of_custom(fields.custom_mode), bool(fields.base_mode & MODE_ARMED))
            case "STATUSTEXT":
                self._words.add(message)
            case "MISSION_CURRENT":
                self.seq = fields.seq
            case "MISSION_REQUEST_INT" | "MISSION_REQUEST":
                self._send(
                    "MISSION_ITEM_INT", *item_fields(_VEHICLE, fields.seq, self._items[fields.seq], False, MISSION)
                )
            case "MISSION_ACK":
                self._has_mission = self._has_mission or fields.type == mav.MAV_MISSION_ACCEPTED

    def _see(self, mode: Mode | None, armed: bool) -> None:
        """Ask for what is still to be done, at every heartbeat."""
        self.mode, self.armed = mode, armed
        self._send("HEARTBEAT", mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3)
        self.flown = self.flown or (self.has_armed and not armed)
        self.has_armed = self.has_armed or armed
        if self.has_armed:
            return
        if not self._has_mission:
            self._send("MISSION_COUNT", *_VEHICLE[1:], len(self._items), MISSION, 0)
        elif mode is not Mode.MISSION:
            self._command(mav.MAV_CMD_MISSION_START)
        else:
            self._command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def _command(self, number: int, p1: float = 0.0) -> None:
        self._send("COMMAND_LONG", *_VEHICLE[1:], number, 0, p1, *[0.0] * 6)

    def _send(self, name: str, *fields: Any) -> None:
        assert self._vehicle is not None, "who is answered has sent"
        self.socket.sendto(self._codec.encode(name, *fields), self._vehicle)


def _item(command: int, east: float, north: float, p1: float = 0.0) -> MissionItem:
    place = geodetic_of((east, north, 0.0), DEFAULT_ORIGIN)
    x, y = round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)
    up = 0.0 if command == mav.MAV_CMD_NAV_LAND else HEIGHT_M
    return MissionItem(mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, command, 1, p1, 0.0, 0.0, nan, x, y, up)
