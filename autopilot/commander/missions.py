"""Uploaded plans, and the task that flies a mission."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import dist, hypot

from colibri.autopilot.commander.fence import CHECKED_AT_ONCE, Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.rules.modes import Mode, Need
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.executor import (
    AuxFunction,
    Circling,
    MissionEvent,
    MissionExecutor,
    MissionRecord,
    Reached,
)
from colibri.autopilot.guidance.mission.items import COPTERS_MAX_HEIGHT_M, places, rally_places
from colibri.autopilot.guidance.mission.legs import Defaults, MissionContext
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Land, Orbit, Order, Return, TakeOff
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask, TaskSequence, homeward, landing
from colibri.autopilot.guidance.tasks.task import FlightTask, TaskContext, TaskOutput
from colibri.common.earth.geodesy import Geodetic, enu_of
from colibri.common.types import Vector
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem, StoredPlan
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.wire.dialect import Refusal, mav
from colibri.mavlink.wire.places import MAX_HEIGHT_M, far, too_far

_PLACE_US = 2.0  # work to find the place of an item
_ON_THE_GROUND = (mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_NAV_VTOL_LAND, mav.MAV_CMD_DO_SET_HOME)
_NONE = Refusal()
_MOVED_M = 1.0
_AT_HOME_M = 2.0
_HOME_FIRST = "item 0 is home, as in ArduPilot: leave it out"


class Missions:
    """The mission of one vehicle, and the plans around it.

    Attributes:
        unmet: Unmet needs of mode mission, with reasons.
        checking: Whether `check_on` is due, as a long mission takes several frames.
        boot_unix_us: Unix time at simulated time 0, if items may name a time of day; else 0.
        functions: Functions of items, to carry out and remove.
    """

    def __init__(self, home: Home, fence: Fence, lines: StatusQueue, behaviour: Behaviour) -> None:
        self._home = home
        self._fence = fence
        self._lines = lines
        self._behaviour = behaviour
        self.executor = MissionExecutor()
        self.unmet: dict[Need, str] = {}
        self._remarks: tuple[str, ...] = ()
        self._rally: Sequence[MissionItem] = ()
        self.checking = False
        self._found: list[tuple[int, Vector]] = []
        self._checked = 0
        self._reached: list[int] = []
        self.boot_unix_us = 0
        self.functions: list[AuxFunction] = []
        self.changes = 0

    @property
    def total(self) -> int:
        return len(self.executor.items)

    def adopt(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour
        self._fence.adopt(behaviour)

    def load(self, plan_type: int, plan: StoredPlan) -> None:
        self.changes += 1
        items: Sequence[MissionItem] = plan.items
        if plan_type == MISSION:
            self.executor.load(items)
            self._lines.say(INFO, f"mission of {len(items)} items" if items else "mission cleared")
        elif plan_type == FENCE:
            self._lines.say(INFO, "geofence loaded" if items else "geofence cleared")
            self._fence.load(items)
        else:
            self._rally = items
            self._lines.say(INFO, f"{len(items)} rally points" if items else "rally points cleared")
            for seq, place in rally_places(items, self._home.position_enu_m, self._home.origin):
                if fault := self._rally_fault(place):
                    self._lines.say(WARNING, f"rally point {seq} is not flown to: {fault}")
        self._check_mission()

    def move_origin(self, place: Geodetic) -> None:
        """Move the origin, vehicle and home; plans stay where they are on earth."""
        moved_m = hypot(*enu_of(place, self._home.origin)[:2])
        self._home.origin = place
        if moved_m > _MOVED_M and (self.total or self._rally or self._fence.loaded):
            self._lines.say(WARNING, f"origin moved by {moved_m:.0f} m: the plans stay where they are")
        self.moved_origin()

    def moved_origin(self) -> None:
        self._fence.rebuild()
        self._check_mission()

    def move_home(self, place: Vector, yaw_rad: float, vehicle: VehicleState) -> None:
        self._home.move(place, yaw_rad)
        doubt = self._home.doubt(vehicle.position_enu_m)
        if doubt:
            self._lines.say(WARNING, doubt)
        self._check_mission()

    def homeward(self, context: TaskContext, *, tells: bool = True) -> TaskSequence:
        """Return to the nearest of home and the rally points inside the fence."""
        home, rally = context.home_enu_m, rally_places(self._rally, context.home_enu_m, self._home.origin)
        places = [place for _, place in rally if not self._rally_fault(place)]
        if not (places and self._behaviour.rally_only):
            places.insert(0, home)
        nearest = min(places, key=lambda place: dist(place[:2], context.place[:2]))
        if tells and nearest is not home:
            self._lines.say(INFO, "returning to a rally point")
        return homeward(context, nearest)

    def task(self) -> "MissionTask":
        self.executor.start()
        return self.task_again()

    def task_again(self, turns: float = 0.0, legs: tuple[int, ...] = ()) -> "MissionTask":
        """Continue a mission, with the current item's turns and remaining legs."""
        behaviour = self._behaviour
        acceptance_m = max(behaviour.acceptance_m, 0.1)
        self.executor.defaults = Defaults(
            acceptance_m,
            behaviour.takeoff_height_m,
            behaviour.orbit_radius_m,
            behaviour.items_face,
            behaviour.copter_items,
        )
        return MissionTask(self.executor, self, turns, legs)

    def resume(self, plans: Mapping[int, StoredPlan], record: MissionRecord | None) -> None:
        self._fence.load(plans[FENCE].items)
        self.executor.load(plans[MISSION].items)
        self._rally = plans[RALLY].items
        if record is not None:
            self.executor.resume(record)

    def watch_mode(self, mode: Mode) -> None:
        if self.executor.active and mode is not Mode.MISSION:
            for event in self.executor.pause(item_flown=mode is Mode.RETURN):
                if isinstance(event, Reached):
                    self._reached.append(event.seq)

    def flown(self, event: MissionEvent, state: VehicleState) -> None:
        if isinstance(event, Reached):
            self._reached.append(event.seq)
        elif isinstance(event, Circling):
            self._lines.say(WARNING, f"item {event.seq} of the mission: endless jumps: cannot be flown")
        elif isinstance(event, AuxFunction):
            self.functions.append(event)
        else:
            self.move_home(event.position_enu_m or state.position_enu_m, state.euler[2], state)

    def _rally_fault(self, place: Vector) -> str:
        outside = self._fence.refusal((*place[:2], self._home.position_enu_m[2]))
        return too_far(place) or (outside.reason if outside else "")

    def take_reached(self) -> list[int]:
        reached, self._reached = self._reached, []
        return reached

    def mission_context(self, context: TaskContext, *, arrived: bool, turns: float) -> MissionContext:
        state = context.state
        return MissionContext(
            state.position_enu_m,
            state.velocity_enu_m_s,
            state.euler[2],
            context.standing,
            arrived,
            turns,
            context.home_enu_m,
            self._home.origin,
            self.boot_unix_us and self.boot_unix_us + context.now_us,
        )

    def check_on(self) -> None:
        """Check more items, at most `CHECKED_AT_ONCE` pairs of a place and an edge."""
        at_once = max(CHECKED_AT_ONCE // self._fence.size, 1)
        part = self._found[self._checked : self._checked + at_once]
        refused = self._fence.first_outside([place for _, place in part]) if part else None
        self._checked += at_once
        self.checking = refused is None and self._checked < len(self._found)
        if not self.checking:
            self._judge("" if refused is None else _of_item(part[refused[0]][0], refused[1].reason))

    def _check_mission(self) -> None:
        """Begin to check the items; legs between them are not checked."""
        items, home = self.executor.items, self._home
        self._fence.budget.spend(_PLACE_US * len(items))
        self._found = list(places(items, home.position_enu_m, home.origin))
        self._checked, self.checking = 0, True
        self.check_on()

    def _judge(self, outside: str) -> None:
        """Report bad items; `outside` names one outside the fence."""
        home, items, said = self._home, self.executor.items, {*self.unmet.values(), *self._remarks}
        found = self._found
        copter = self._behaviour.copter_items  # then a height of 0 keeps the height
        without = (*_ON_THE_GROUND, mav.MAV_CMD_NAV_TAKEOFF) if copter else _ON_THE_GROUND
        max_height_m = COPTERS_MAX_HEIGHT_M if copter else MAX_HEIGHT_M
        flown = [each for each in found if items[each[0]].command not in without and (items[each[0]].z or not copter)]
        reasons = {
            Need.WITHIN_REACH: _first(found, partial(too_far, max_height_m=max_height_m)),
            Need.INSIDE_FENCE: outside,
            Need.ABOVE_GROUND: _first(flown, lambda place: (home.refusal(place[2]) or _NONE).reason),
        }
        self.unmet = {need: reason for need, reason in reasons.items() if reason}
        away = "" if Need.WITHIN_REACH in self.unmet else _first(found, lambda place: far(place, home.position_enu_m))
        low = "" if Need.ABOVE_GROUND in self.unmet else _first(flown, lambda place: home.remark(place[2]))
        hint = _HOME_FIRST if _is_home_first(flown, home.position_enu_m, low or reasons[Need.ABOVE_GROUND]) else ""
        self._remarks = tuple(filter(None, (away and f"{away} from home", low, hint)))
        for text in (*self.unmet.values(), *self._remarks):
            if text not in said:
                self._lines.say(WARNING, text)


def _first(found: Iterable[tuple[int, Vector]], fault: Callable[[Vector], str]) -> str:
    return next((_of_item(seq, reason) for seq, place in found if (reason := fault(place))), "")


def _is_home_first(flown: Sequence[tuple[int, Vector]], home_enu_m: Vector, fault: str) -> bool:
    """Whether the fault is of item 0, which is home in files of ArduPilot."""
    first = flown[0] if flown else None
    if first is None or first[0] != 0 or not fault.startswith(_of_item(0, "")):
        return False
    return max(abs(first[1][0] - home_enu_m[0]), abs(first[1][1] - home_enu_m[1])) < _AT_HOME_M


def _of_item(seq: int, reason: str) -> str:
    return f"item {seq} of the mission: {reason}"


class MissionTask:
    """Flies the executor's orders; `returns` if the mission ends with mode return."""

    def __init__(self, executor: MissionExecutor, missions: Missions, turns: float, legs: tuple[int, ...]) -> None:
        self._executor = executor
        self._missions = missions
        self._order: Order | None = None
        self._turns_before, self._legs_left = turns, legs
        self._task: FlightTask = HoldTask()
        self._done = False
        self.returns = False

    def update(self, context: TaskContext) -> TaskOutput:
        arrived = self._task.arrived(context)
        mission_context = self._missions.mission_context(context, arrived=arrived, turns=self.turns)
        step = self._executor.step(mission_context, context.now_us)
        for event in step.events:
            self._missions.flown(event, context.state)
        if step.order is not self._order:
            if self._order is not None:
                self._turns_before = 0.0
            self._order = step.order
            returns = isinstance(step.order, Return)
            self._task = self._missions.homeward(context, tells=False) if returns else task_of(step.order, context)
            if isinstance(self._task, TaskSequence):
                self._task.skip(self._legs_left)
            self._legs_left = ()
        self._done = not step.flying
        if self._done and isinstance(self._task, OrbitTask):
            self._task = HoldTask()
        self.returns = isinstance(step.order, Return) and step.flying
        return self._task.update(context)

    @property
    def turns(self) -> float:
        return self._turns_before + (self._task.turns if isinstance(self._task, OrbitTask) else 0.0)

    @property
    def legs(self) -> tuple[int, ...]:
        return self._task.left if isinstance(self._task, TaskSequence) else ()

    def arrived(self, context: TaskContext) -> bool:
        del context
        return self._done


def task_of(order: Order, context: TaskContext, takeoff_speed_m_s: float | None = None) -> FlightTask:
    """Return the task of an order; take-off defaults to the climb speed."""
    match order:
        case GoTo():
            return GoToTask(order, context)
        case Orbit():
            return OrbitTask(order, context)
        case TakeOff():
            return TakeoffTask(order.height_enu_m, order.yaw_rad, context, takeoff_speed_m_s)
        case Land():
            return landing(order)
        case Return() | Hold():
            return HoldTask()
