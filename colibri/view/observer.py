"""The page's end of a MAVLink link: asks for telemetry and plans, passes orders on, and hears their answers.

No input or output: datagrams and the time go in, datagrams come out. It does not say that it is a ground station: no
vehicle shall come home because somebody has closed a browser.
"""

from math import nan
from typing import Any

import numpy as np

from colibri.common.earth.geodesy import geodetic_of
from colibri.common.types import Vector
from colibri.mavlink.mission.items import FENCE, MISSION, PLAN_TYPES, RALLY, MissionItem, item_of
from colibri.mavlink.services.command import GLOBAL_FRAMES
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Codec, Message, definition_of, mav
from colibri.view.geometry import circle
from colibri.view.modes import ARDUPILOT, set_mode
from colibri.view.snapshot import Mark, Surroundings, Zone
from colibri.view.telemetry import INTERVALS_US, Telemetry

SYSTEM, COMPONENT = 253, 191
_BEAT_S = 1.0
_AGAIN_S = 1.0
_TRIES = 4
_PLANS_EVERY_S = 10.0
_RESULTS = {number: each.name.removeprefix("MAV_RESULT_").lower() for number, each in mav.enums["MAV_RESULT"].items()}
_IN_PROGRESS: int = mav.MAV_RESULT_IN_PROGRESS
_FENCES = {
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
    mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}
_CIRCLES = (mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
ABSOLUTE_FRAMES = (mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_INT)


class Observer:
    """Watches the first vehicle that it meets on a link.

    Attributes:
        telemetry: What the vehicle is like.
        surroundings: Another object whenever its plans or home change.
    """

    def __init__(self) -> None:
        """Know no vehicle."""
        self.telemetry = Telemetry()
        self.surroundings = Surroundings()
        self._codec = Codec(SYSTEM, COMPONENT)
        self._outbox: list[bytes] = []
        self._beat_at_s = self._plans_at_s = float("-inf")
        self._order: tuple[str, int, tuple[str, tuple[Any, ...]], int, float] | None = None
        self._counts: dict[int, int] = {}
        self._items: dict[int, dict[int, MissionItem]] = {kind: {} for kind in PLAN_TYPES}
        self._drawn: Any = None

    def take_outbox(self) -> list[bytes]:
        """Return what is to be sent, and forget it."""
        sent, self._outbox = self._outbox, []
        return sent

    def receive(self, datagram: bytes, now_s: float) -> None:
        """Take in what has come."""
        for message in self._codec.decode(datagram):
            system, component = message.source
            if component != AUTOPILOT_COMPONENT or (self.telemetry.system not in (0, system)):
                continue
            if message.name == "HEARTBEAT" and not self.telemetry.system:
                self.telemetry.system = system
                self._ask_for_telemetry()
            self.telemetry.receive(message, now_s)
            self._converse(message)

    def poll(self, now_s: float) -> None:
        """Say what is due."""
        if now_s >= self._beat_at_s:
            self._beat_at_s = now_s + _BEAT_S
            self._send("HEARTBEAT", mav.MAV_TYPE_GENERIC, mav.MAV_AUTOPILOT_INVALID, 0, 0, mav.MAV_STATE_ACTIVE, 3)
        if self.telemetry.system and now_s >= self._plans_at_s:
            self._plans_at_s = now_s + _PLANS_EVERY_S
            for kind in PLAN_TYPES:
                self._send("MISSION_REQUEST_LIST", *self._vehicle, kind)
        if self._order is not None and now_s >= self._order[4]:
            self._repeat(now_s)
        self._draw()

    # Orders.

    def arm(self, armed: bool) -> None:
        """Arm or disarm."""
        self._command("arm" if armed else "disarm", mav.MAV_CMD_COMPONENT_ARM_DISARM, float(armed))

    def take_off(self, height_m: float) -> None:
        """Take off to a height above home."""
        if self.telemetry.autopilot == ARDUPILOT:
            self._command("take off", mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m)
            return
        origin = self.telemetry.origin
        if origin is None:
            self.telemetry.say("take off: the vehicle has not said where it is")
            return
        home_up = self.telemetry.home_enu_m[2]
        above_sea = origin.altitude_m + (0.0 if home_up != home_up else home_up) + height_m
        self._command("take off", mav.MAV_CMD_NAV_TAKEOFF, -1.0, 0.0, 0.0, nan, nan, nan, above_sea)

    def land(self) -> None:
        """Land where it is."""
        self._command("land", mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan, nan, nan, 0.0)

    def return_home(self) -> None:
        """Return home."""
        self._command("return", mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def set_mode(self, name: str) -> None:
        """Change the mode, by its word."""
        params = set_mode(self.telemetry.autopilot, name)
        if params is None:
            self.telemetry.say(f"mode {name}: not known of this autopilot")
        else:
            self._command(f"mode {name}", mav.MAV_CMD_DO_SET_MODE, *params)

    def go_to(self, place_enu_m: Vector) -> None:
        """Go to a place, ENU."""
        origin = self.telemetry.origin
        if origin is None:
            self.telemetry.say("go to: the vehicle has not said where it is")
            return
        there = geodetic_of(place_enu_m, origin)
        x, y = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
        up = origin.altitude_m + place_enu_m[2]
        head = (*self._vehicle, mav.MAV_FRAME_GLOBAL, mav.MAV_CMD_DO_REPOSITION, 0, 0)
        change_mode = float(mav.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
        fields = (*head, -1.0, change_mode, 0.0, nan, x, y, up)
        east, north, _ = place_enu_m
        self._give(f"go to {east:.1f}, {north:.1f}", mav.MAV_CMD_DO_REPOSITION, "COMMAND_INT", fields)

    @property
    def _vehicle(self) -> tuple[int, int]:
        return self.telemetry.system, AUTOPILOT_COMPONENT

    def _command(self, what: str, number: int, *params: float) -> None:
        values = (*params, *(0.0,) * (7 - len(params)))
        self._give(what, number, "COMMAND_LONG", (*self._vehicle, number, 0, *values))

    def _give(self, what: str, number: int, name: str, fields: tuple[Any, ...]) -> None:
        """Send a command at the next poll, and again until it is acknowledged; one at a time, the newest."""
        if not self.telemetry.system:
            self.telemetry.say(f"{what}: no vehicle is there")
            return
        self._order = (what, number, (name, fields), _TRIES, float("-inf"))

    def _repeat(self, now_s: float) -> None:
        assert self._order is not None
        what, number, (name, fields), tries, _ = self._order
        if tries == 0:
            self.telemetry.say(f"{what}: no answer")
            self._order = None
            return
        self._send(name, *fields)
        self._order = (what, number, (name, fields), tries - 1, now_s + _AGAIN_S)

    # What comes back.

    def _converse(self, message: Message) -> None:
        fields = message.fields
        if getattr(fields, "target_system", SYSTEM) not in (0, SYSTEM):
            return
        if message.name == "COMMAND_ACK" and self._order is not None and fields.command == self._order[1]:
            if fields.result != _IN_PROGRESS:
                self.telemetry.say(f"{self._order[0]}: {_RESULTS.get(fields.result, fields.result)}")
                self._order = None
        elif message.name == "MISSION_COUNT":
            kind = fields.mission_type
            if kind in self._items:
                self._counts[kind] = fields.count
                self._items[kind] = {}
                self._ask_for_item(kind)
        elif message.name == "MISSION_ITEM_INT":
            self._take_item(message)

    def _take_item(self, message: Message) -> None:
        kind, seq = message.fields.mission_type, message.fields.seq
        item = item_of(message.name, message.fields)
        if kind in self._items and isinstance(item, MissionItem) and seq < self._counts.get(kind, 0):
            self._items[kind][seq] = item
            self._ask_for_item(kind)

    def _ask_for_item(self, kind: int) -> None:
        missing = next((seq for seq in range(self._counts[kind]) if seq not in self._items[kind]), None)
        if missing is not None:
            self._send("MISSION_REQUEST_INT", *self._vehicle, missing, kind)
        elif self._counts[kind]:
            self._send("MISSION_ACK", *self._vehicle, mav.MAV_MISSION_ACCEPTED, kind)

    def _ask_for_telemetry(self) -> None:
        for name, interval_us in INTERVALS_US.items():
            wanted = (float(definition_of(name).id), float(interval_us), 0.0, 0.0, 0.0, 0.0, 0.0)
            self._send("COMMAND_LONG", *self._vehicle, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *wanted)

    def _send(self, name: str, *fields: Any) -> None:
        self._outbox.append(self._codec.encode(name, *fields))

    # What is drawn of plans.

    def _draw(self) -> None:
        """Make the surroundings anew where a plan that is whole, the origin or home has changed."""
        whole = {kind: items for kind, items in self._items.items() if len(items) == self._counts.get(kind, -1)}
        home = self.telemetry.home_enu_m
        now = (self.telemetry.origin, str(home), {kind: tuple(sorted(items.items())) for kind, items in whole.items()})
        if len(whole) < sum(kind in self._counts for kind in PLAN_TYPES) or str(now) == self._drawn:
            return
        self._drawn = str(now)
        self.surroundings = Surroundings(
            ground_m=0.0 if home[2] != home[2] else home[2],
            home_enu_m=home,
            mission=self._marks(MISSION, ""),
            rally=self._marks(RALLY, "rally "),
            fence=self._zones(),
        )

    def _marks(self, kind: int, word: str) -> tuple[Mark, ...]:
        marks = []
        for seq, item in sorted(self._items[kind].items()):
            if item.frame in GLOBAL_FRAMES and (item.x or item.y):
                place = self._place(item)
                if place[0] == place[0]:
                    marks.append(Mark(place, f"{word}{seq + 1}"))
        return tuple(marks)

    def _place(self, item: MissionItem) -> Vector:
        above_sea = item.frame in ABSOLUTE_FRAMES
        return self.telemetry.place_of(item.x / 1e7, item.y / 1e7, item.z, above_sea=above_sea)

    def _zones(self) -> tuple[Zone, ...]:
        zones: list[Zone] = []
        corners: list[tuple[float, float]] = []
        for _, item in sorted(self._items[FENCE].items()):
            if item.command not in _FENCES:
                continue
            east, north, _ = self._place(item)
            if east != east:
                return ()
            if item.command in _CIRCLES:
                zones.append(Zone(circle(east, north, item.p1), _FENCES[item.command]))
                continue
            corners.append((east, north))
            if len(corners) == round(item.p1):
                zones.append(Zone(np.array(corners), _FENCES[item.command]))
                corners = []
        return tuple(zones)
