"""Missions, geofence and rally points in flight: the plans that were uploaded, and the course that flies a mission."""

from collections.abc import Mapping, Sequence

from colibri.autopilot.commander.commands import Commands
from colibri.autopilot.commander.pilot import Pilot
from colibri.autopilot.commander.rules.modes import Event, Mode
from colibri.autopilot.guidance.mission.executor import MissionExecutor, MissionRecord, Reached, SetHome
from colibri.autopilot.guidance.mission.geofence import AroundHome, Geofence, check_fence, check_fence_item
from colibri.autopilot.guidance.mission.items import check_item, check_mission, check_rally_item, places
from colibri.autopilot.guidance.mission.legs import Defaults, Situation
from colibri.autopilot.guidance.tasks.orbit import Round
from colibri.autopilot.guidance.tasks.orders import Circle, GoTo, Hold, Land, Order, Return, TakeOff
from colibri.autopilot.guidance.tasks.position import Climb, Legs, Stop, Way, homeward, landing
from colibri.autopilot.guidance.tasks.task import Asked, Course, Scene
from colibri.common.types import Vector
from colibri.mavlink.mission.items import ACCEPTED, FENCE, MISSION, RALLY, MissionItem, Plan, plan_of
from colibri.mavlink.mission.service import MissionService, Vehicle
from colibri.mavlink.mission.upload import Rules
from colibri.mavlink.services.statustext import INFO, WARNING, StatusText
from colibri.mavlink.wire.refusal import Refusal

_LOOK_EVERY_US = 100_000


class Missions:
    """The plans of one vehicle.

    Attributes:
        service: Speaks the mission protocol.
        executor: Flies the mission.
        changes: How often a plan was replaced.
    """

    def __init__(self, pilot: Pilot, commands: Commands, text: StatusText) -> None:
        """Begin without plans."""
        self._pilot = pilot
        self._commands = commands
        self.executor = MissionExecutor()
        self.changes = 0
        self._fence = Geofence((), commands.origin)
        self._outside = ""
        self._breach: Refusal | None = None
        self._breach_due_us = 0
        rules = {
            MISSION: Rules(check_item, check_mission),
            FENCE: Rules(check_fence_item, check_fence),
            RALLY: Rules(check_rally_item, lambda _: ACCEPTED),
        }
        vehicle = Vehicle(self._load, lambda: self.executor.progress, self._set_current, commands.guided_goto)
        self.service = MissionService(rules, vehicle, text)

    @property
    def has_mission(self) -> bool:
        """Whether there is something to fly."""
        return bool(self.executor.items)

    @property
    def leaves_fence(self) -> bool:
        """Whether the mission goes to a place where the geofence does not let the vehicle be."""
        return bool(self._outside)

    @property
    def has_fence(self) -> bool:
        """Whether there is a geofence, uploaded or around home."""
        return bool(self.service.plans[FENCE].items) or self._around_home.exists

    @property
    def _around_home(self) -> AroundHome:
        behaviour = self._pilot.behaviour
        return AroundHome(self._pilot.home_enu_m, behaviour.farthest_m, behaviour.highest_m)

    def fence_refusal(self, place: Vector) -> Refusal | None:
        """Return why the vehicle may not fly to a place; None if it may."""
        return self._fence.refusal(place) or self._around_home.refusal(place)

    def margin_m(self, place: Vector) -> float:
        """Return how far a place is inside of every fence, m; negative outside."""
        return min(self._fence.margin_m(place), self._around_home.margin_m(place))

    def breach(self, place: Vector, now_us: int) -> Refusal | None:
        """Return why the vehicle may not be where it is; looked at ten times a second, fences take time."""
        if not self.has_fence:
            self._breach = None
        elif now_us >= self._breach_due_us:
            self._breach_due_us = now_us + _LOOK_EVERY_US
            self._breach = self.fence_refusal(place)
        return self._breach

    def moved_origin(self) -> None:
        """See the geofence from another origin."""
        self._fence_in(self.service.plans[FENCE].items)

    def course(self) -> "MissionCourse":
        """Start the mission, and return its course, from the current item on."""
        self.executor.start()
        return self.course_again()

    def course_again(self, turns: float = 0.0, legs: tuple[int, ...] = ()) -> "MissionCourse":
        """Return the course of a mission that is flown already, or that is over while the rotors still turn.

        Args:
            turns: How many turns of the current item were flown before.
            legs: How many legs of it are left; empty before it began.
        """
        behaviour = self._pilot.behaviour
        self.executor.defaults = Defaults(
            max(behaviour.acceptance_m, 0.1), behaviour.takeoff_height_m, behaviour.orbit_radius_m
        )
        return MissionCourse(self.executor, self, turns, legs)

    @property
    def ids(self) -> tuple[int, ...]:
        """Opaque ids of the plans."""
        return tuple(plan.id for plan in self.service.plans.values())

    def resume(self, plans: Mapping[int, Sequence[MissionItem]], ids: tuple[int, ...], record: MissionRecord) -> None:
        """Have the plans that were kept, and go on where the mission stood; from its first item if it is another."""
        for plan_type in (RALLY, FENCE, MISSION):
            self.service.plans[plan_type] = plan_of(plans.get(plan_type, ()))
        self.executor.load(self.service.plans[MISSION].items)
        if self.ids == ids:
            self.executor.resume(record)

    def watch_mode(self, mode: Mode) -> None:
        """Pause the mission once another mode flies."""
        if self.executor.active and mode is not Mode.MISSION:
            for event in self.executor.pause(item_flown=mode is Mode.RETURN):
                if isinstance(event, Reached):
                    self.service.reached(event.seq)

    def flown(self, event: Reached | SetHome) -> None:
        """Take note of what the mission did."""
        if isinstance(event, Reached):
            self.service.reached(event.seq)
            return
        scene = self._pilot.scene()
        self._pilot.set_home(event.position_enu_m or scene.state.position_enu_m, scene.state.euler[2])

    def says_return(self) -> None:
        """Leave the rest of the flight to mode return."""
        self._pilot.happened(Event.RETURN_ITEM)

    def situation(self, scene: Scene, *, arrived: bool, turns: float) -> Situation:
        """Return what the mission sees."""
        state = scene.state
        return Situation(
            state.position_enu_m,
            state.velocity_enu_m_s,
            state.euler[2],
            self._pilot.standing,
            arrived,
            turns,
            scene.home_enu_m,
            self._commands.origin,
        )

    def _load(self, plan_type: int, plan: Plan) -> None:
        self.changes += 1
        items: Sequence[MissionItem] = plan.items
        if plan_type == MISSION:
            self.executor.load(items)
            self._pilot.say(INFO, f"mission of {len(items)} items" if items else "mission cleared")
        elif plan_type == FENCE:
            self._pilot.say(INFO, "geofence loaded" if items else "geofence cleared")
            self._fence_in(items)
        self._check_mission()

    def _fence_in(self, items: Sequence[MissionItem]) -> None:
        self._fence = Geofence(items, self._commands.origin)
        self._breach, self._breach_due_us = None, 0
        self._check_mission()

    def _check_mission(self) -> None:
        """Look for an item that leads outside the geofence; the way between two items is not looked at."""
        pilot, before = self._pilot, self._outside
        found = places(self.executor.items, pilot.home_enu_m, self._commands.origin) if self.has_fence else ()
        outside = [(seq, refusal.reason) for seq, place in found if (refusal := self.fence_refusal(place))]
        self._outside = f"item {outside[0][0]} of the mission: {outside[0][1]}" if outside else ""
        if self._outside and self._outside != before:
            pilot.say(WARNING, self._outside)

    def _set_current(self, seq: int, reset: bool) -> Refusal | None:
        return self.executor.set_current(seq, reset)


class MissionCourse:
    """Flies what the executor orders, one course after another."""

    def __init__(
        self, executor: MissionExecutor, missions: Missions, turns: float = 0.0, legs: tuple[int, ...] = ()
    ) -> None:
        """Begin with the current item, of which `turns` around a centre were flown before, and `legs` are left."""
        self._executor = executor
        self._missions = missions
        self._order: Order | None = None
        self._turns_before, self._legs_left = turns, legs
        self._course: Course = Stop()
        self._done = False

    def ask(self, scene: Scene) -> Asked:
        """Return what the order of now asks for."""
        arrived = self._course.arrived(scene)
        situation = self._missions.situation(scene, arrived=arrived, turns=self.turns)
        step = self._executor.step(situation, scene.now_us)
        for event in step.events:
            self._missions.flown(event)
        if step.order is not self._order:
            if self._order is not None:
                self._turns_before = 0.0
            self._order = step.order
            self._course = course_of(step.order, scene)
            if isinstance(self._course, Legs):
                self._course.skip(self._legs_left)
            self._legs_left = ()
        self._done = not step.flying
        if self._done and isinstance(self._course, Round):
            self._course = Stop()
        if isinstance(step.order, Return) and step.flying:
            self._missions.says_return()
        return self._course.ask(scene)

    @property
    def turns(self) -> float:
        """How often it went around the centre of the order that is flown."""
        return self._turns_before + (self._course.turns if isinstance(self._course, Round) else 0.0)

    @property
    def legs(self) -> tuple[int, ...]:
        """How many legs are left of the order that is flown."""
        return self._course.left if isinstance(self._course, Legs) else ()

    def arrived(self, scene: Scene) -> bool:
        """Whether the mission is flown to its end."""
        del scene
        return self._done


def course_of(order: Order, scene: Scene) -> Course:
    """Return how an order is flown."""
    match order:
        case GoTo():
            return Way(order, scene)
        case Circle():
            return Round(order, scene)
        case TakeOff():
            return Climb(order.height_enu_m, order.yaw_rad, scene)
        case Land():
            return landing(order)
        case Return():
            return homeward(scene)
        case Hold():
            return Stop()
