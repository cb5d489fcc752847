"""A relay that acts at chosen simulated instants, and a ground station beside it."""

import random
import socket
from collections.abc import Callable, Sequence
from enum import Enum
from math import nan
from select import select
from time import monotonic

from colibri.autopilot.commander.rules.modes import Mode, mode_of_custom
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.commands import Command
from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.client.plans import Upload
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, MODE_ARMED, Message, mav
from colibri.sitl.mission_items import Item
from tools.harness.ports import bound_socket

_VEHICLE = (1, AUTOPILOT_COMPONENT)
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


HOVERS = frozenset(range(2, 2 * len(_PLACES) + 1, 2))  # items of the mission with a hover


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


GIVE_UP_AFTER_S, COMPILES_S = 60.0, 900.0  # bounds for what hangs; the first autopilot may have to compile
_MAX_DATAGRAM_BYTES = 65536
_LOOK_S = 0.02
_HEAD = 10  # bytes of a frame of MAVLink 2 before its payload
_TIMES = {dialect.MSG_ATTITUDE_QUATERNION: (4, 1000), dialect.MSG_HIL_SENSOR: (8, 1)}
"""Bytes of the time in a frame of the plant, and its unit, µs."""
_ANSWER = 93  # HIL_ACTUATOR_CONTROLS


class KillInstant(Enum):
    """Instant of a kill within the exchange of a frame."""

    BEFORE = "before the frame comes"
    DURING = "while the answer is computed"
    AFTER = "when the answer is sent"
    LOST = "when the answer is sent, which is lost"


class HangsError(Exception):
    """A wait timed out."""


class Between:
    """Relays between a plant and the autopilots that call it in turn."""

    def __init__(self, plant: tuple[str, int]) -> None:
        self._plant = plant
        self.time_us = 0
        self._due: tuple[int, KillInstant, Callable[[], None]] | None = None
        self._chance = random.Random(0)
        self._open()

    def at(self, time_us: int, phase: KillInstant, do: Callable[[], None]) -> None:
        """Do something once, with the first frame from `time_us` on."""
        self._due = (time_us, phase, do)

    @property
    def waits(self) -> bool:
        return self._due is not None

    def cut(self) -> None:
        """Drop the autopilot, and wait for the next."""
        self.close()
        self._open()

    def fly_until(
        self, station: KillStation, condition: Callable[[], bool], what: str, give_up_after_s: float = GIVE_UP_AFTER_S
    ) -> None:
        """Relay, and serve the station, until `condition()`; `HangsError` after a bound."""
        give_up_s = monotonic() + give_up_after_s
        while not condition():
            ready, _, _ = select([self._near, self._far, station.socket], [], [], _LOOK_S)
            for sock in (self._near, self._far):
                if sock in ready and sock.fileno() >= 0:
                    self._pass_on(sock)
            if station.socket in ready:
                station.receive()
            if monotonic() > give_up_s:
                said = f"{station.mode}, item {station.seq}, {station.texts[-3:]}"
                raise HangsError(f"waited in vain for {what} at t = {self.time_us * 1e-6:.3f} s: {said}")

    def close(self) -> None:
        self._near.close()
        self._far.close()

    def _open(self) -> None:
        self._near, self.url = bound_socket()
        self._far, _ = bound_socket()
        for sock in (self._near, self._far):
            sock.setblocking(False)
        self._autopilot: tuple[str, int] | None = None

    def _pass_on(self, sock: socket.socket) -> None:
        while sock.fileno() >= 0:
            try:
                datagram, sender = sock.recvfrom(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                continue
            if sock is self._near:
                self._autopilot = sender
                self._from_autopilot(datagram)
            else:
                self._from_plant(datagram)

    def _from_plant(self, datagram: bytes) -> None:
        count, unit_us = _TIMES.get(_number(datagram), (0, 0))
        if count:
            payload = datagram[_HEAD : _HEAD + min(count, datagram[1])]  # zeros at a payload's end are left out
            self.time_us = int.from_bytes(payload, "little") * unit_us
        if self._is_due(KillInstant.BEFORE):
            return
        if self._autopilot:
            self._send(self._near, datagram, self._autopilot)
        self._is_due(KillInstant.DURING)

    def _from_autopilot(self, datagram: bytes) -> None:
        is_answer = _number(datagram) == _ANSWER
        far = self._far
        if is_answer and self._is_due(KillInstant.LOST):
            return
        if far.fileno() >= 0:
            self._send(far, datagram, self._plant)
        if is_answer:
            self._is_due(KillInstant.AFTER)

    def _is_due(self, phase: KillInstant) -> bool:
        """Do the planned action if it is due; return whether it was."""
        if self._due is None or self._due[1] is not phase or self.time_us < self._due[0]:
            return False
        (_, _, do), self._due = self._due, None
        do()
        return True

    def _send(self, sock: socket.socket, datagram: bytes, address: tuple[str, int]) -> None:
        try:
            sock.sendto(datagram, address)
        except ConnectionRefusedError:
            return


def _number(datagram: bytes) -> int:
    return int.from_bytes(datagram[7:_HEAD], "little")
