"""Missions in flight: the plans that were uploaded, and the task that flies a mission."""

from collections.abc import Mapping, Sequence

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.rules.modes import Mode
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.mission.executor import MissionExecutor, MissionRecord, Reached, SetHome
from colibri.autopilot.guidance.mission.items import places
from colibri.autopilot.guidance.mission.legs import Defaults, MissionContext
from colibri.autopilot.guidance.tasks.orbit import OrbitTask
from colibri.autopilot.guidance.tasks.orders import Circle, GoTo, Hold, Land, Order, Return, TakeOff
from colibri.autopilot.guidance.tasks.position import GoToTask, HoldTask, TakeoffTask, TaskSequence, homeward, landing
from colibri.autopilot.guidance.tasks.task import FlightTask, TaskContext, TaskOutput
from colibri.mavlink.mission.items import FENCE, MISSION, MissionItem, Plan
from colibri.mavlink.mission.service import Progress
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.wire.dialect import mav
from colibri.mavlink.wire.refusal import Refusal


class Missions:
    """The mission of one vehicle, and the fence that it must keep to.

    Attributes:
        changes: How often a plan was replaced.
    """

    def __init__(self, home: Home, fence: Fence, lines: StatusQueue, behaviour: Behaviour) -> None:
        self._home = home
        self._fence = fence
        self._lines = lines
        self._behaviour = behaviour
        self._executor = MissionExecutor()
        self._outside = self._below = ""
        self._reached: list[int] = []
        self.changes = 0

    @property
    def has_mission(self) -> bool:
        """Whether there is something to fly."""
        return bool(self._executor.items)

    @property
    def leaves_fence(self) -> bool:
        """Whether the mission goes to a place where the geofence does not let the vehicle be."""
        return bool(self._outside)

    @property
    def leads_below_ground(self) -> bool:
        """Whether the mission goes to a place below the ground."""
        return bool(self._below)

    def adopt(self, behaviour: Behaviour) -> None:
        """Adopt other numbers."""
        self._behaviour = behaviour
        self._fence.adopt(behaviour)

    def progress(self) -> Progress:
        """Return where the mission stands; the same object while nothing changes."""
        return self._executor.progress

    def load(self, plan_type: int, plan: Plan) -> None:
        """Replace a plan by one of valid items."""
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
        """Go to an item, -1 for the current one; `reset` resets the counts of jumps. Return why not."""
        return self._executor.set_current(seq, reset)

    def moved_origin(self) -> None:
        """Measure the fence and the mission from the origin as it is now."""
        self._fence.rebuild()
        self._check_mission()

    def task(self) -> "MissionTask":
        """Start the mission, and return its task, from the current item on."""
        self._executor.start()
        return self.task_again()

    def task_again(self, turns: float = 0.0, legs: tuple[int, ...] = ()) -> "MissionTask":
        """Return the task of a mission under way, `turns` and `legs` of its current item as before a restart."""
        behaviour = self._behaviour
        self._executor.adopt(
            Defaults(max(behaviour.acceptance_m, 0.1), behaviour.takeoff_height_m, behaviour.orbit_radius_m)
        )
        return MissionTask(self._executor, self, turns, legs)

    def record(self) -> MissionRecord:
        """Return where the mission stands."""
        return self._executor.record()

    def resume(self, plans: Mapping[int, Plan], record: MissionRecord | None) -> None:
        """Restore the plans, and the progress of the mission; without a record it begins with its first item."""
        self._fence.load(plans[FENCE].items)
        self._executor.load(plans[MISSION].items)
        if record is not None:
            self._executor.resume(record)

    def watch_mode(self, mode: Mode) -> None:
        """Pause the mission once another mode flies."""
        if self._executor.active and mode is not Mode.MISSION:
            for event in self._executor.pause(item_flown=mode is Mode.RETURN):
                if isinstance(event, Reached):
                    self._reached.append(event.seq)

    def flown(self, event: Reached | SetHome, state: VehicleState) -> None:
        """Adopt an event of the mission."""
        if isinstance(event, Reached):
            self._reached.append(event.seq)
        else:
            self._home.move(event.position_enu_m or state.position_enu_m, state.euler[2])

    def take_reached(self) -> list[int]:
        """Return the items that were reached since the last call."""
        reached, self._reached = self._reached, []
        return reached

    def mission_context(self, context: TaskContext, *, arrived: bool, turns: float) -> MissionContext:
        """Return the inputs of the mission."""
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

    def _check_mission(self) -> None:
        """Look for items that lead outside the fence or below the ground; the way between two is not checked."""
        home, items, said = self._home, self._executor.items, (self._outside, self._below)
        found = list(places(items, home.position_enu_m, home.origin))
        outside = ((seq, refusal.reason) for seq, place in found if (refusal := self._fence.refusal(place)))
        flown = ((seq, place) for seq, place in found if items[seq].command != mav.MAV_CMD_NAV_LAND)
        below = ((seq, refusal.reason) for seq, place in flown if (refusal := home.refusal(place[2])))
        self._outside, self._below = (
            f"item {seq} of the mission: {reason}" if reason else ""
            for seq, reason in (next(outside, (0, "")), next(below, (0, "")))
        )
        for text in (self._outside, self._below):
            if text and text not in said:
                self._lines.say(WARNING, text)


class MissionTask:
    """Flies the executor's orders, one task after another.

    Attributes:
        returns: Whether the mission leaves the rest of the flight to mode return.
    """

    def __init__(
        self, executor: MissionExecutor, missions: Missions, turns: float = 0.0, legs: tuple[int, ...] = ()
    ) -> None:
        """Begin with the current item, `turns` of which were flown before a restart, and `legs` are left."""
        self._executor = executor
        self._missions = missions
        self._order: Order | None = None
        self._turns_before, self._legs_left = turns, legs
        self._task: FlightTask = HoldTask()
        self._done = False
        self.returns = False

    def update(self, context: TaskContext) -> TaskOutput:
        """Return the output of the current order's task."""
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
        """How often the circle of the order was flown around."""
        return self._turns_before + (self._task.turns if isinstance(self._task, OrbitTask) else 0.0)

    @property
    def legs(self) -> tuple[int, ...]:
        """How many legs are left of the order that is flown."""
        return self._task.left if isinstance(self._task, TaskSequence) else ()

    def arrived(self, context: TaskContext) -> bool:
        """Whether the mission is flown to its end."""
        del context
        return self._done


def task_of(order: Order, context: TaskContext, takeoff_speed_m_s: float | None = None) -> FlightTask:
    """Return how an order is flown; a take-off at `takeoff_speed_m_s`, or None: at the speed of climbs."""
    match order:
        case GoTo():
            return GoToTask(order, context)
        case Circle():
            return OrbitTask(order, context)
        case TakeOff():
            return TakeoffTask(order.height_enu_m, order.yaw_rad, context, takeoff_speed_m_s)
        case Land():
            return landing(order)
        case Return():
            return homeward(context)
        case Hold():
            return HoldTask()
