"""The pilot: modes, arming, take-off, landing, and the references of the control law."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from colibri.autopilot.commander.flight.ground_contact import GroundContact, GroundRecord
from colibri.autopilot.commander.flight.readiness import Readiness
from colibri.autopilot.commander.flight.reference_generator import ReferenceGenerator
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.missions import MissionTask
from colibri.autopilot.commander.rules.failsafe_rule import FlightState
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import FIRST, MANUAL, Event, Mode, Need, State, next_state
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour, at_speed
from colibri.autopilot.guidance.guidance import RESTS, Guidance, Instants
from colibri.autopilot.guidance.landing_detector import is_below, stands_at_first
from colibri.autopilot.guidance.reference import Reference
from colibri.autopilot.guidance.tasks.position import HoldTask, TrackTask
from colibri.autopilot.guidance.tasks.task import (
    NOT_STEERED,
    AttitudeMotion,
    ClientInputs,
    FlightTask,
    PlannedMotion,
    PositionMotion,
    TaskContext,
    TaskOutput,
    lifts,
)
from colibri.common.records import Record
from colibri.common.types import Vector
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.wire.dialect import Refusal

TaskFactory: TypeAlias = Callable[[Mode, TaskContext], FlightTask]
_SAVED_BY = {
    Action.HOLD: Event.SAVED_BY_HOLD,
    Action.RETURN: Event.SAVED_BY_RETURN,
    Action.LAND: Event.SAVED_BY_LANDING,
    Action.DESCEND: Event.SAVED_BY_LANDING,
    Action.TERMINATE: Event.TERMINATED,
}
_ENDS = {Mode.TAKEOFF: Event.ARRIVED, Mode.MISSION: Event.FINISHED, Mode.TRACK: Event.FINISHED}
"""Event when the task of a mode has arrived."""
NOTHING_MISSING: Mapping[Need, str] = MappingProxyType({})
_TEXTS = {
    Event.ARRIVED: "Takeoff altitude reached: {mode}",
    Event.FINISHED: "{before} finished: {mode}",
    Event.RETURN_ITEM: "Mission RTL item: {mode}",
    Event.TOUCHED_DOWN: "Disarmed by landing",
    Event.LEFT_STANDING: "Disarmed by auto preflight disarming",
}
"""Status texts, as far as possible PX4's."""
_IMPACT = "Disarmed by impact"


class Sensed(Record, frozen=True):
    """Inputs of a control sample; references are for `delay_us` later, when commands take effect.

    Attributes:
        push: Tilting moment then that the rotors do not cause, over that of a quarter of the weight at a rotor.
        jolt_s: Recent impulse along body z then that the rotors do not cause, in seconds of weight.
    """

    now_us: int = 0
    vehicle: VehicleState | None = None
    steered: ClientInputs = NOT_STEERED
    position_known: bool = True
    delay_us: int = 0
    waited_us: int = 0  # path time lost since the previous sample
    path_speed: float = 1.0  # rate of path time relative to the clock
    lift: float | None = None  # modelled thrust over weight, once a sensor has failed
    push: float = 0.0
    jolt_s: float = 0.0
    drifts: bool = False  # the speed is not measured


class PilotRecord(Record, frozen=True):
    """Attributes of `Pilot` and its parts for a restart, without the task."""

    state: State
    ground: GroundRecord
    home_enu_m: Vector
    home_yaw_rad: float
    home_is_chosen: bool
    speed_m_s: float | None
    saving: Action
    reference: Reference
    lag_us: int = 0


class Pilot:
    """State machine of mode, task and failsafe; each method is an event.

    Attributes:
        speed_m_s: Requested cruise speed; None for the parameters'.
        stays_armed: Whether the vehicle stays armed on the ground beyond its time.
        saving: Active failsafe, until a mode is selected or the rotors stop.
        terminated: Whether a failsafe stopped the rotors in the air.
    """

    def __init__(
        self, instants: Instants, behaviour: Behaviour, make_task: TaskFactory, home: Home, lines: StatusQueue
    ) -> None:
        self._make_task = make_task
        self._lines = lines
        self.state = FIRST
        self.behaviour = behaviour
        self.home = home
        self.ground = GroundContact(lines)
        self.generator = ReferenceGenerator(instants, behaviour.limits)
        self.readiness = Readiness(lines)
        self.sensed = Sensed()
        self.lag_us = 0
        self.task: FlightTask = HoldTask()
        self.wanted: TaskOutput | None = None
        self._task_is_chosen = False
        self.speed_m_s: float | None = None
        self.stays_armed: Callable[[], bool] = lambda: False
        self.saving = Action.NONE
        self.terminated = False

    def begin(
        self, now_us: int, vehicle: VehicleState, *, mode: Mode | None = None, rests: bool = False, delay_us: int = 0
    ) -> None:
        """Start a flight; a vehicle that `rests` stands at any height, because estimated heights are inexact."""
        self.sensed = self.sensed._replace(now_us=now_us, vehicle=vehicle, delay_us=delay_us)
        standing = mode is None and (rests or stands_at_first(vehicle, 0.0))
        self.generator.follow(vehicle)
        if standing:
            self.home.propose(vehicle.position_enu_m, vehicle.euler[2])
        self.state = FIRST if standing else State(mode or Mode.HOLD, armed=True)
        self.ground.begin(now_us, standing=standing)
        self._engage(self.state.mode)

    def record(self) -> PilotRecord:
        assert self.generator.reference is not None, "the vehicle has been seen"
        home = self.home
        return PilotRecord(
            self.state,
            self.ground.record(),
            home.position_enu_m,
            home.yaw_rad,
            home.chosen,
            self.speed_m_s,
            self.saving,
            self.generator.reference,
            self.lag_us,
        )

    def resume(
        self, now_us: int, vehicle: VehicleState, record: PilotRecord, again: TaskFactory, *, seamless: bool
    ) -> None:
        """Restore the state; `again` returns the task that continues a mode.

        A vehicle that came down stays on the ground. A `seamless` restart keeps the reference.
        """
        self.sensed = self.sensed._replace(now_us=now_us, vehicle=vehicle)
        self.home.move(record.home_enu_m, record.home_yaw_rad, chosen=record.home_is_chosen)
        self.home.armed_yaw_rad = record.home_yaw_rad
        self.speed_m_s, self.lag_us = record.speed_m_s, record.lag_us
        ground = record.ground
        came_down = not seamless and not ground.standing and stands_at_first(vehicle, ground.height_m)
        self.ground.resume(ground, came_down=came_down)
        self.state = FIRST if came_down else record.state
        self.saving = Action.NONE if came_down else record.saving
        if seamless:
            self.generator.set(record.reference)
        else:
            self.generator.follow(vehicle)
        self._take((self._make_task if came_down else again)(self.state.mode, self.context()))
        self._task_is_chosen = not came_down

    def adopt(self, behaviour: Behaviour) -> None:
        self.behaviour = behaviour
        if not behaviour.rotor_failure:
            self.readiness.rotor_failed = ""

    def sense(self, sensed: Sensed) -> None:
        self.lag_us += sensed.waited_us
        self.generator.wait(sensed.waited_us * 1e-6, sensed.path_speed)
        self.sensed = sensed
        self.ground.drifts = sensed.drifts

    def context(self) -> TaskContext:
        sensed, vehicle = self.sensed, self.sensed.vehicle
        reference, behaviour = self.generator.reference, self.behaviour
        assert vehicle is not None, "the vehicle has been seen"
        assert reference is not None, "the vehicle has been seen"
        speed = behaviour.limits.speed_m_s if self.speed_m_s is None else self.speed_m_s
        speed = min(speed, behaviour.max_speed_m_s)
        if speed != behaviour.limits.speed_m_s:
            behaviour = at_speed(behaviour, speed)
        return TaskContext(
            sensed.now_us + sensed.delay_us - self.lag_us,
            vehicle,
            reference,
            self.home.position_enu_m,
            behaviour,
            self.generator.interval_s,
            self.generator.samples,
            sensed.steered,
            self.ground.standing,
            self.ground.height_m,
            blind=self.saving is Action.DESCEND or not sensed.position_known,
            home_yaw_rad=self.home.armed_yaw_rad,
        )

    def warn(self, text: str) -> None:
        self._lines.say(WARNING, text)

    def say(self, severity: int, text: str) -> None:
        self._lines.say(severity, text)

    @property
    def flight(self) -> FlightState:
        return FlightState(self.state.armed, self.ground.standing, self.state.mode, self.saving)

    def arm(self, missing: Mapping[Need, str], *, force: bool = False) -> Refusal | None:
        if self.state.armed:
            return None
        forced = force and self.sensed.vehicle is not None and not self.readiness.only_lands
        reasons = [] if forced else self.readiness.refusals()
        if reasons:
            return Refusal("Arming denied: " + "; ".join(reasons))
        # position has a check of its own, which force skips
        refusal = self._follow(Event.ARM, "Armed", missing=_without(Need.POSITION, missing))
        if refusal is None:
            vehicle = self.sensed.vehicle
            self.ground.arm(self.sensed.now_us)
            self.terminated = False
            if vehicle is not None:
                self.home.propose(vehicle.position_enu_m, vehicle.euler[2])
            if not self._task_is_chosen:
                self._engage(self.state.mode)
        return refusal

    def disarm(self, *, force: bool = False) -> Refusal | None:
        if not self.state.armed:
            return None
        standing = self.ground.standing
        if not standing and not force:
            return Refusal("Disarming denied: not landed")
        return self._stop_rotors(Event.DISARM, "Disarmed" if standing else "Disarmed in flight")

    def select(self, mode: Mode, missing: Mapping[Need, str]) -> Refusal | None:
        if mode is self.state.mode and mode is not Mode.HOLD:
            return None
        refusal = self._follow(Event.SELECT, "", mode, missing)
        if refusal is None:
            self.saving = Action.NONE
            self._engage(mode)
        return refusal

    def fly(self, mode: Mode, task: FlightTask, missing: Mapping[Need, str]) -> Refusal | None:
        refusal = self._follow(Event.SELECT, "", mode, _without(Need.CIRCLE, missing))
        if refusal is None:
            self.saving = Action.NONE
            self.task, self._task_is_chosen = task, True
        return refusal

    def save(self, action: Action) -> None:
        """Execute a failsafe's action, chosen by the supervisor."""
        if not self.state.armed:
            return
        if action is Action.TERMINATE:
            self.terminated = not self.ground.standing
            self._stop_rotors(Event.TERMINATED, "")
            return
        self.saving = action
        self._follow(_SAVED_BY[action], "")
        self._engage(self.state.mode)

    def happened(self, event: Event) -> None:
        before = self.state
        stays = event in (Event.ARRIVED, Event.FINISHED)  # where the task that ends has led
        if self._follow(event, _TEXTS[event]) is None and self.state.mode is not before.mode and not stays:
            self._engage(self.state.mode)

    def touch_down(self) -> None:
        """Register a landing reported by another detector, and stop the rotors."""
        self.ground.land(self.sensed.now_us)
        self._stop_rotors(Event.TOUCHED_DOWN, self._end(Event.TOUCHED_DOWN))

    def step(self) -> Guidance:
        if not self.state.armed:
            return self._rest()
        context = self.context()
        wanted = self.wanted = self.task.update(context)
        if isinstance(self.task, MissionTask) and self.task.returns:
            self.happened(Event.RETURN_ITEM)
        if self.ground.standing:
            if not (wanted.lifts if isinstance(wanted, AttitudeMotion) else lifts(wanted.target, context.state)):
                return self._idle()
            self.ground.take_off(self.sensed.now_us)
        guidance = self._guidance(context, wanted, begins=self.ground.spin_up())
        if self._has_hit_ground(context.state):
            return self._fallen()
        ended = _ENDS.get(self.state.mode)
        if ended is not None and self.task.arrived(context):
            self.happened(ended)
        return guidance

    def _guidance(
        self, context: TaskContext, wanted: AttitudeMotion | PositionMotion | PlannedMotion, *, begins: bool
    ) -> Guidance:
        now_us, vehicle = self.sensed.now_us, context.state
        if isinstance(wanted, AttitudeMotion):
            self.generator.set(wanted.reference)
            height_m = wanted.reference.height_m
            if self.ground.watch(now_us, vehicle, height_m, sinks=wanted.sinks, drifts=wanted.drifts):
                return self._fallen()
            return Guidance(attitude=wanted.demand, begins=begins)
        horizon = self.generator.lead(context, wanted)
        height_m = context.reference.height_m
        if self.ground.watch(now_us, vehicle, height_m, sinks=is_below(height_m, vehicle)):
            return self._fallen()
        return Guidance(horizon=horizon, begins=begins, pace=wanted.pace)

    def _fallen(self) -> Guidance:
        self._stop_rotors(Event.TOUCHED_DOWN, _IMPACT)
        return self._rest()

    def _has_hit_ground(self, vehicle: VehicleState) -> bool:
        """Watch for the ground by forces if a sensor has failed; return whether the contact was an impact."""
        sensed, generator = self.sensed, self.generator
        if sensed.lift is None or generator.reference is None:
            return False
        comes_down = self.state.mode is Mode.LAND or is_below(generator.reference.height_m, vehicle)
        return comes_down and self.ground.watch_forces(
            sensed.now_us, vehicle, sensed.lift, sensed.push, sensed.jolt_s, generator.interval_s
        )

    def _rest(self) -> Guidance:
        vehicle = self.sensed.vehicle
        assert vehicle is not None, "the vehicle has been seen"
        self.generator.rest(vehicle)
        self.ground.rest(self.sensed.now_us, vehicle)
        return RESTS

    def _idle(self) -> Guidance:
        self._rest()
        event = self.ground.end_of_idling(self.sensed.now_us, self.behaviour, by_sticks=self.state.mode in MANUAL)
        if event is not None and not (event is Event.LEFT_STANDING and self.stays_armed()):
            self._stop_rotors(event, self._end(event))
        return RESTS

    @property
    def _stays_down(self) -> str:
        """Reason why an armed vehicle that has landed must not take off again."""
        ground = self.ground
        landed = ground.standing and ground.times.landing_us > ground.times.armed_us
        return self.readiness.inputs.not_known if landed else ""

    def _end(self, event: Event) -> str:
        return _IMPACT if event is Event.TOUCHED_DOWN and self.ground.impact else _TEXTS[event]

    def _stop_rotors(self, event: Event, text: str) -> Refusal | None:
        refusal = self._follow(event, text)
        if refusal is None:
            self.speed_m_s = None
            self.saving = Action.NONE
            self.ground.stop()
            self._engage(self.state.mode)
        return refusal

    def _engage(self, mode: Mode) -> None:
        if self.generator.reference is not None:
            self._take(self._make_task(mode, self.context()))
            self._task_is_chosen = False

    def _take(self, task: FlightTask) -> None:
        self.task = task
        if isinstance(task, TrackTask) and task.start is not None:
            self.generator.set(task.start)

    def _follow(
        self, event: Event, text: str, selected: Mode | None = None, missing: Mapping[Need, str] = NOTHING_MISSING
    ) -> Refusal | None:
        why = self.readiness.only_lands or self._stays_down
        if event is Event.SELECT and self.state.armed and why:
            return Refusal(f"{selected} refused: {why}")
        after = next_state(self.state, event, selected, missing)
        if isinstance(after, Refusal):
            return after
        if after != self.state and text:
            self._lines.say(INFO, text.format(before=self.state.mode.capitalize(), mode=after.mode))
        self.state = after
        return None


def _without(met: Need, missing: Mapping[Need, str]) -> dict[Need, str]:
    return {need: why for need, why in missing.items() if need is not met}
