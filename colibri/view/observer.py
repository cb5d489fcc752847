"""The page's end of a MAVLink link: requests telemetry and plans, sends commands, without I/O.

It does not identify as a ground station: closing a browser must not trigger a failsafe.
"""

from collections.abc import Callable, Mapping, Sequence
from math import nan

import numpy as np

from colibri.common.earth.geodesy import geodetic_of
from colibri.common.types import Vector
from colibri.mavlink.client.client import Client, ConversationEnded, VehicleFound
from colibri.mavlink.client.commands import Command, CommandInt, set_message_interval
from colibri.mavlink.client.conversation import UNANSWERED, Repeat, Target
from colibri.mavlink.client.modes import ARDUPILOT, PX4, mode_named
from colibri.mavlink.client.plans import Download
from colibri.mavlink.mission.items import FENCE, MISSION, PLAN_TYPES, RALLY, MissionItem
from colibri.mavlink.services.command import GLOBAL_FRAMES
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, TYPE_GENERIC, mav
from colibri.view.geometry import circle
from colibri.view.snapshot import Mark, Surroundings, Zone
from colibri.view.telemetry import INTERVALS_US, Telemetry

_POLYGONS = {
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False}

Place = Callable[[MissionItem], Vector]
"""(item) -> its place in the local frame, ENU; nan if unknown."""


def drawn(plans: Mapping[int, Sequence[MissionItem]], home_enu_m: Vector, place: Place) -> Surroundings:
    return Surroundings(
        ground_m=0.0 if home_enu_m[2] != home_enu_m[2] else home_enu_m[2],
        home_enu_m=home_enu_m,
        mission=_marks(plans.get(MISSION, ()), "", place),
        rally=_marks(plans.get(RALLY, ()), "rally ", place),
        fence=_zones(plans.get(FENCE, ()), place),
    )


def _marks(items: Sequence[MissionItem], word: str, place: Place) -> tuple[Mark, ...]:
    marks = []
    for seq, item in enumerate(items):
        if item.frame in GLOBAL_FRAMES and (item.x or item.y):
            there = place(item)
            if there[0] == there[0]:
                marks.append(Mark(there, f"{word}{seq + 1}"))
    return tuple(marks)


def _zones(items: Sequence[MissionItem], place: Place) -> tuple[Zone, ...]:
    zones: list[Zone] = []
    corners: list[tuple[float, float]] = []
    for item in items:
        if item.command not in _POLYGONS and item.command not in _CIRCLES:
            continue
        east, north, _ = place(item)
        if east != east:
            return ()
        if item.command in _CIRCLES:
            zones.append(Zone(circle(east, north, item.p1), _CIRCLES[item.command]))
            continue
        corners.append((east, north))
        if len(corners) == round(item.p1):
            zones.append(Zone(np.array(corners), _POLYGONS[item.command]))
            corners = []
    return tuple(zones)


SYSTEM, COMPONENT = 253, 191
CHOICES: dict[int, tuple[str, ...]] = {
    PX4: ("Hold", "Position", "Altitude", "Mission", "Return", "Land"),
    ARDUPILOT: ("Guided", "Loiter", "Alt Hold", "Auto", "Brake", "RTL", "Land"),
}
"""Modes that the page offers, by MAV_AUTOPILOT."""
_REPEAT = Repeat(every_us=1_000_000, tries=4)
_PLANS_EVERY_US = 10_000_000
_RESULTS = {number: each.name.removeprefix("MAV_RESULT_").lower() for number, each in mav.enums["MAV_RESULT"].items()}
_ABSOLUTE_FRAMES = (mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_INT)


class VehicleObserver:
    """Watches the first vehicle; `surroundings` is a new object after each change."""

    def __init__(self) -> None:
        self.telemetry = Telemetry()
        self.surroundings = Surroundings()
        self._client = Client(SYSTEM, COMPONENT, kind=TYPE_GENERIC)
        self._plans_at_us = 0
        self._order: tuple[str, Command] | None = None
        self._plans: dict[int, Sequence[MissionItem]] = {}
        self._drawn = ""

    def receive(self, datagram: bytes, now_s: float) -> None:
        for message in self._client.receive(datagram, round(now_s * 1e6)):
            self._note_events()
            if self.telemetry.system in (0, message.source[0]):
                self.telemetry.receive(message, now_s)

    def poll(self, now_s: float) -> list[bytes]:
        now_us = round(now_s * 1e6)
        if self.telemetry.system and now_us >= self._plans_at_us:
            self._plans_at_us = now_us + _PLANS_EVERY_US
            for plan in PLAN_TYPES:
                self._client.begin(Download(self._vehicle, plan, repeat=_REPEAT))
        datagrams = self._client.poll(now_us)
        self._note_events()
        self._draw()
        return datagrams

    # Commands.

    def arm(self, armed: bool) -> None:
        self._command("arm" if armed else "disarm", mav.MAV_CMD_COMPONENT_ARM_DISARM, float(armed))

    def take_off(self, height_m: float) -> None:
        if self.telemetry.autopilot == ARDUPILOT:
            self._command("take off", mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m)
            return
        origin = self.telemetry.origin
        if origin is None:
            self.telemetry.say("take off: no position received")
            return
        home_up = self.telemetry.home_enu_m[2]
        above_sea = origin.altitude_m + (0.0 if home_up != home_up else home_up) + height_m
        self._command("take off", mav.MAV_CMD_NAV_TAKEOFF, -1.0, 0.0, 0.0, nan, nan, nan, above_sea)

    def land(self) -> None:
        self._command("land", mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan, nan, nan, 0.0)

    def return_home(self) -> None:
        self._command("return", mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def set_mode(self, name: str) -> None:
        mode = mode_named(self.telemetry.autopilot, name)
        if mode is None:
            self.telemetry.say(f"mode {name}: unknown for this autopilot")
        else:
            self._command(f"mode {name}", mav.MAV_CMD_DO_SET_MODE, *mode.command)

    def go_to(self, place_enu_m: Vector) -> None:
        origin = self.telemetry.origin
        if origin is None:
            self.telemetry.say("go to: no position received")
            return
        there = geodetic_of(place_enu_m, origin)
        east, north, up = place_enu_m
        command = CommandInt(
            self._vehicle,
            mav.MAV_CMD_DO_REPOSITION,
            *(-1.0, float(mav.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE), 0.0, nan),
            frame=mav.MAV_FRAME_GLOBAL,
            x=round(there.latitude_deg * 1e7),
            y=round(there.longitude_deg * 1e7),
            z=origin.altitude_m + up,
            repeat=_REPEAT,
        )
        self._give(f"go to {east:.1f}, {north:.1f}", command)

    @property
    def _vehicle(self) -> Target:
        return self.telemetry.system, AUTOPILOT_COMPONENT

    def _command(self, what: str, number: int, *params: float) -> None:
        self._give(what, Command(self._vehicle, number, *params, repeat=_REPEAT))

    def _give(self, what: str, command: Command) -> None:
        if not self.telemetry.system:
            self.telemetry.say(f"{what}: no vehicle connected")
            return
        if self._order is not None:
            self._client.cancel(self._order[1])
        self._order = (what, self._client.begin(command))

    # Answers.

    def _note_events(self) -> None:
        for event in self._client.take_events():
            match event:
                case VehicleFound(vehicle) if not self.telemetry.system:
                    self.telemetry.system = vehicle.system
                    for name, interval_us in INTERVALS_US.items():
                        self._client.begin(set_message_interval(vehicle.target, name, interval_us, repeat=_REPEAT))
                case ConversationEnded(Download() as download) if download.accepted:
                    self._plans[download.plan] = download.items
                case ConversationEnded(Command() as command) if self._order is not None and command is self._order[1]:
                    result = command.result
                    words = "no answer" if result == UNANSWERED else _RESULTS.get(result, result)
                    self.telemetry.say(f"{self._order[0]}: {words}")
                    self._order = None

    def _draw(self) -> None:
        home = self.telemetry.home_enu_m
        now = str((self.telemetry.origin, home, self._plans))
        if now != self._drawn:
            self._drawn = now
            self.surroundings = drawn(self._plans, home, self._place)

    def _place(self, item: MissionItem) -> Vector:
        above_sea = item.frame in _ABSOLUTE_FRAMES
        return self.telemetry.place_of(item.x / 1e7, item.y / 1e7, item.z, above_sea=above_sea)
