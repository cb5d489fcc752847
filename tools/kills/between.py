"""A relay that acts at chosen simulated instants, and a ground station beside it."""

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
from colibri.mavlink.client.plans import Upload
from colibri.mavlink.mission.items import MissionItem
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, MODE_ARMED, Message, mav
from colibri.sitl.mission_items import Item, land, on_wire, takeoff, waypoint
from tools.harness.ports import OnPort, Relay, serve

_VEHICLE = (1, AUTOPILOT_COMPONENT)
HOVER_S = 6.0
HEIGHT_M = 6.0
_PLACES = ((22.0, 0.0), (22.0, 18.0), (0.0, 18.0), (0.0, 0.0))
LEGS = len(_PLACES)
HOVERS = frozenset(range(2, 2 * LEGS + 1, 2))  # items of the mission with a hover


def mission(legs: int = LEGS) -> list[MissionItem]:
    items = [takeoff(HEIGHT_M)]
    for place in _PLACES[:legs]:
        hover = Item(mav.MAV_CMD_NAV_LOITER_TIME, (HOVER_S, 0.0, 0.0, nan), (*place, HEIGHT_M))
        items += [waypoint(*place, HEIGHT_M, within_m=0.0), hover]
    return on_wire([*items, land(*_PLACES[legs - 1])], DEFAULT_ORIGIN)


class KillStation(OnPort):
    """A ground station that uploads a mission, and begins it."""

    def __init__(self, items: Sequence[MissionItem]) -> None:
        super().__init__(self)
        self._items = items
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget the flight, with the datagrams that wait."""
        while select(self.sockets, [], [], 0.0)[0]:
            self.sockets[0].recv(1)
        self.mode: Mode | None = None
        self.armed: bool | None = None
        self.seq = 0
        self.flown = self.has_armed = False
        self.texts: list[str] = []
        self._client = Client(255, mav.MAV_COMP_ID_MISSIONPLANNER, only=_VEHICLE[0])
        self._upload: Upload | None = None
        self._under_way: Conversation | None = None

    def receive(self, datagram: bytes, now_s: float) -> list[bytes]:
        now_us = round(now_s * 1e6)
        for message in self._client.receive(datagram, now_us):
            self._take(message)
        return self._client.poll(now_us)

    def _take(self, message: Message) -> None:
        fields = message.fields
        match message.name:
            case "HEARTBEAT":
                self._see(mode_of_custom(fields.custom_mode), bool(fields.base_mode & MODE_ARMED))
            case "STATUSTEXT":
                self.texts.append(fields.text)
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


GIVE_UP_AFTER_S, COMPILES_S = 60.0, 900.0  # bounds for what hangs; the first autopilot may have to compile
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


class Between(Relay):
    """Relays between a plant and the autopilots that call it in turn."""

    def __init__(self, plant_url: str) -> None:
        super().__init__(plant_url)
        self.time_us = 0
        self._due: tuple[int, KillInstant, Callable[[], None]] | None = None

    def at(self, time_us: int, phase: KillInstant, do: Callable[[], None]) -> None:
        """Do something once, with the first frame from `time_us` on."""
        self._due = (time_us, phase, do)

    @property
    def waits(self) -> bool:
        return self._due is not None

    def cut(self) -> None:
        """Drop the autopilot, and wait for the next."""
        self.close()
        self.open()

    def fly_until(
        self, station: KillStation, condition: Callable[[], bool], what: str, give_up_after_s: float = GIVE_UP_AFTER_S
    ) -> None:
        """Relay, and serve the station, until `condition()`; `HangsError` after a bound."""
        give_up_s = monotonic() + give_up_after_s
        while not condition():
            serve(self, station)
            if monotonic() > give_up_s:
                said = f"{station.mode}, item {station.seq}, {station.texts[-3:]}"
                raise HangsError(f"waited in vain for {what} at t = {self.time_us * 1e-6:.3f} s: {said}")

    def pass_on(self, to: str, datagram: bytes) -> None:
        message_id = int.from_bytes(datagram[7:_HEAD], "little")
        is_answer = message_id == _ANSWER
        if to == "autopilot":
            count, unit_us = _TIMES.get(message_id, (0, 0))
            if count:
                payload = datagram[_HEAD : _HEAD + min(count, datagram[1])]  # zeros at a payload's end are left out
                self.time_us = int.from_bytes(payload, "little") * unit_us
            if not self._is_due(KillInstant.BEFORE):
                self.deliver(to, datagram)
                self._is_due(KillInstant.DURING)
        elif not (is_answer and self._is_due(KillInstant.LOST)):
            self.deliver(to, datagram)
            if is_answer:
                self._is_due(KillInstant.AFTER)

    def _is_due(self, phase: KillInstant) -> bool:
        """Do the planned action if it is due; return whether it was."""
        if self._due is None or self._due[1] is not phase or self.time_us < self._due[0]:
            return False
        (_, _, do), self._due = self._due, None
        do()
        return True
