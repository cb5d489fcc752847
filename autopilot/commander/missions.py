"""Uploaded plans, and the task that flies a mission."""

from collections.abc import Iterator, Mapping, Sequence

from colibri.autopilot.commander.fence import CHECKED_AT_ONCE, Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.executor import MissionExecutor, MissionRecord, Reached, SetHome
from colibri.autopilot.guidance.mission.items import places
from colibri.autopilot.guidance.mission.legs import Defaults, MissionContext
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import GoTo, Hold, Land, Orbit, Order, Return, TakeOff
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask, TaskSequence, homeward, landing
from colibri.autopilot.guidance.tasks.task import FlightTask, TaskContext, TaskOutput
from colibri.mavlink.mission.items import FENCE, MISSION, MissionItem, StoredPlan
from colibri.mavlink.mission.service import MissionProgress
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.refusal import Refusal

_PLACE_US = 2.0
"""Work to find the place of an item."""


class Missions:
    """The mission of one vehicle, and the plans around it.

    Attributes:
        outside, below: Why items lead outside the fence or below the ground; empty if they do not.
        checking: Whether `check_on` is due at the next frame, as the check of a long mission takes several.
        changes: Number of uploads.
    """

    def __init__(self, home: Home, fence: Fence, lines: StatusQueue, behaviour: Behaviour) -> None:
        self._home = home
        self._fence = fence
        self._lines = lines
        self._behaviour = behaviour
        self._executor = MissionExecutor()
        self.outside = self.below = ""
        self.checking = False
        self._check: Iterator[int] = iter(())
        self._reached: list[int] = []
        self.changes = 0

    @property
    def has_mission(self) -> bool:
        return bool(self._executor.items)

    def adopt(self, behaviour: Behaviour) -> None:
        self._behaviour = behaviour
        self._fence.adopt(behaviour)

    def progress(self) -> MissionProgress:
        return self._executor.progress

    def load(self, plan_type: int, plan: StoredPlan) -> None:
        self.changes += 1
        items: Sequence[MissionItem] = plan.items
        if plan_type == MISSION:
            self._executor.load(items)
            self._lines.say(INFO, f"mission of {len(items)} items" if items else "mission cleared")
        elif plan_type == FENCE:
            self._lines.say(INFO, "geofence loaded" if items else "geofence cleared")
            self._fence.load(items)
        self._check_mission()

    def set_current(self, seq: int, reset: bool) -> Refusal | None:
        return self._executor.set_current(seq, reset)

    def moved_origin(self) -> None:
        self._fence.rebuild()
        self._check_mission()

    def task(self) -> "MissionTask":
        self._executor.start()
        return self.task_again()

    def task_again(self, turns: float = 0.0, legs: tuple[int, ...] = ()) -> "MissionTask":
        """Continue a mission after a restart, with the current item's turns and remaining legs."""
        behaviour = self._behaviour
        self._executor.defaults = Defaults(
            max(behaviour.acceptance_m, 0.1), behaviour.takeoff_height_m, behaviour.orbit_radius_m
        )
        return MissionTask(self._executor, self, turns, legs)

    def record(self) -> MissionRecord:
        return self._executor.record()

    def resume(self, plans: Mapping[int, StoredPlan], record: MissionRecord | None) -> None:
        self._fence.load(plans[FENCE].items)
        self._executor.load(plans[MISSION].items)
        if record is not None:
            self._executor.resume(record)

    def watch_mode(self, mode: Mode) -> None:
        if self._executor.active and mode is not Mode.MISSION:
            for event in self._executor.pause(item_flown=mode is Mode.RETURN):
                if isinstance(event, Reached):
                    self._reached.append(event.seq)

    def flown(self, event: Reached | SetHome, state: VehicleState) -> None:
        if isinstance(event, Reached):
            self._reached.append(event.seq)
        else:
            self._home.move(event.position_enu_m or state.position_enu_m, state.euler[2])

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
        )

    def check_on(self) -> None:
        """Check a few more items: at most `CHECKED_AT_ONCE` pairs of a place and an edge of the fence."""
        self.checking = next(self._check, None) is not None

    def _check_mission(self) -> None:
        self._check = self._checked()
        self.check_on()

    def _checked(self) -> Iterator[int]:
        """Warn of items outside the fence or below the ground; legs between items are not checked."""
        home, items, said = self._home, self._executor.items, (self.outside, self.below)
        self._fence.budget.spend(_PLACE_US * len(items))
        found = list(places(items, home.position_enu_m, home.origin))
        at_once = max(CHECKED_AT_ONCE // self._fence.size, 1)
        outside = ""
        for first in range(0, len(found), at_once):
            part = found[first : first + at_once]
            refused = self._fence.first_outside([place for _, place in part])
            if refused is not None:
                outside = _of_item(part[refused[0]][0], refused[1])
                break
            if first + at_once < len(found):
                yield first + at_once
        flown = ((seq, place) for seq, place in found if items[seq].command != mav.MAV_CMD_NAV_LAND)
        below = (_of_item(seq, refusal) for seq, place in flown if (refusal := home.refusal(place[2])))
        self.outside, self.below = outside, next(below, "")
        for text in (self.outside, self.below):
            if text and text not in said:
                self._lines.say(WARNING, text)


def _of_item(seq: int, refusal: Refusal) -> str:
    return f"item {seq} of the mission: {refusal.reason}"


class MissionTask:
    """Flies the executor's orders; `returns` if the mission ends with mode return."""

    def __init__(
        self, executor: MissionExecutor, missions: Missions, turns: float = 0.0, legs: tuple[int, ...] = ()
    ) -> None:
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
            self._task = task_of(step.order, context)
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
        case Return():
            return homeward(context)
        case Hold():
            return HoldTask()
