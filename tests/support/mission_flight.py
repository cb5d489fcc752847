"""A stand-in for vehicle and navigator that moves straight to where the mission executor sends it."""

from math import atan2, cos, dist, nan, sin, tau

from hypothesis import strategies as st

from colibri.autopilot.guidance.mission.executor import (
    ACTIVE,
    COMPLETE,
    AuxFunction,
    Circling,
    MissionExecutor,
    Reached,
    SetHome,
)
from colibri.autopilot.guidance.mission.items import COPTER_RULES, FLOWN, MISSION_RULES, SKIPPED
from colibri.autopilot.guidance.mission.legs import Defaults, MissionContext
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Land, Orbit, Order, Return, TakeOff
from colibri.common.earth.geodesy import DEFAULT_ORIGIN
from colibri.common.types import Vector
from colibri.mavlink.mission.items import ACCEPTED, MissionItem
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.services.command import GLOBAL_FRAMES
from colibri.mavlink.wire.dialect import mav
from colibri.sitl.mission_items import Item

STEP_US = 20_000
HOME = (2.0, -3.0, 0.5)


def item(
    command: str, place: Vector | None = None, p1: float = nan, p2: float = nan, p3: float = nan, p4: float = nan
) -> MissionItem:
    """Return an item at a place that is relative to home."""
    there = None if place is None else (HOME[0] + place[0], HOME[1] + place[1], place[2])
    return Item(getattr(mav, f"MAV_CMD_{command}"), (p1, p2, p3, p4), there).on_wire(DEFAULT_ORIGIN)


class Flight:
    """A vehicle that moves at 5 m/s, or as fast as it is told, and a navigator that judges when it arrived."""

    def __init__(self, *items: MissionItem, flying: bool = True, rules: Rules = MISSION_RULES) -> None:
        assert all(rules.check_item(each) == ACCEPTED for each in items)
        defaults = Defaults(acceptance_m=0.5, takeoff_height_m=2.5, orbit_radius_m=10.0, copter=rules is COPTER_RULES)
        self.mission = MissionExecutor(items, defaults)
        self.position: Vector = (HOME[0], HOME[1], HOME[2] + (5.0 if flying else 0.0))
        self.landed = not flying
        self.yaw = 0.0
        self.arrived = False
        self.turns = 0.0
        self.turned: list[float] = []
        self.now_us = 0
        self.orders: list[Order] = []
        self.reached: list[int] = []
        self.circling: list[int] = []
        self.functions: list[AuxFunction] = []
        self.homes: list[Vector | None] = []
        self.speeds: list[float] = []

    def fly(self, seconds: float, until: int = COMPLETE) -> None:
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us and self.mission.progress.state != until:
            self.step()

    def step(self) -> None:
        self.now_us += STEP_US
        mission_context = MissionContext(
            self.position, (0.0, 0.0, 0.0), self.yaw, self.landed, self.arrived, self.turns, HOME, DEFAULT_ORIGIN
        )
        step = self.mission.step(mission_context, self.now_us)
        assert step.flying == (self.mission.progress.state == ACTIVE)
        self.reached += [event.seq for event in step.events if isinstance(event, Reached)]
        self.circling += [event.seq for event in step.events if isinstance(event, Circling)]
        self.functions += [event for event in step.events if isinstance(event, AuxFunction)]
        self.homes += [event.position_enu_m for event in step.events if isinstance(event, SetHome)]
        if not self.orders or self.orders[-1] is not step.order:
            self.orders.append(step.order)
            self.turned.append(self.turns)
            self.turns = 0.0
        before = self.position
        self._obey(step.order)
        self.speeds.append(dist(before, self.position) / (STEP_US * 1e-6))

    def _obey(self, order: Order) -> None:
        x, y, _ = self.position
        self.arrived = False
        match order:
            case GoTo(place, yaw, speed):
                self.arrived = self._towards(place, speed or 5.0)
                self.yaw = self.yaw if yaw is None else yaw
            case TakeOff(height, _):
                self.arrived = self._towards((x, y, height), 2.0)
                self.landed = False
            case Land(place, _):
                there = place or (x, y, HOME[2])
                self.landed = self.arrived = self._towards((there[0], there[1], HOME[2]), 5.0)
            case Return():
                self.landed = self.arrived = self._towards(HOME, 5.0)
            case Orbit((east, north, up), radius, speed, _):
                angle = atan2(y - north, x - east) - (speed or 5.0) * STEP_US * 1e-6 / radius
                self.position = (east + abs(radius) * cos(angle), north + abs(radius) * sin(angle), up)
                self.turns += (speed or 5.0) * STEP_US * 1e-6 / (abs(radius) * tau)
            case Hold():
                self.arrived = True

    def _towards(self, place: Vector, speed: float) -> bool:
        away, maximum = dist(self.position, place), speed * STEP_US * 1e-6
        part = min(1.0, maximum / away) if away > 0.0 else 1.0
        x, y, z = (a + part * (b - a) for a, b in zip(self.position, place, strict=True))
        self.position = (x, y, z)
        return part == 1.0

    def kinds(self) -> list[str]:
        return [type(order).__name__ for order in self.orders]


def begun(*items: MissionItem, flying: bool = True) -> Flight:
    flight = Flight(*items, flying=flying)
    assert flight.mission.start() is None
    return flight


def from_home(flight: Flight) -> Vector:
    x, y, z = (a - b for a, b in zip(flight.position, HOME, strict=True))
    return (x, y, z)


FLOATS = st.floats(width=32)
INTS = st.integers(-(2**31), 2**31 - 1)
COMMANDS = st.one_of(
    st.sampled_from([*sorted(FLOWN | SKIPPED), 5000, 5001, 5002, 5003, 5004, 5100]), st.integers(0, 65535)
)

ITEMS = st.builds(
    MissionItem,
    st.one_of(st.sampled_from(sorted(GLOBAL_FRAMES)), st.integers(0, 255)),
    COMMANDS,
    st.integers(0, 255),
    *[FLOATS] * 4,
    INTS,
    INTS,
    FLOATS,
)
