"""The pilot: modes, arming, take-off and landing; decides what the control law is given to follow."""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import NamedTuple, TypeAlias

import numpy as np

from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.missions import MissionTask
from colibri.autopilot.commander.rules.arming import ArmingInputs, refusals
from colibri.autopilot.commander.rules.failsafe_rule import Flight
from colibri.autopilot.commander.rules.failsafe_table import Action
from colibri.autopilot.commander.rules.modes import FIRST, Event, Mode, Need, State, next_state
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.control.interface import AttitudeDemand, Horizon, VehicleState
from colibri.autopilot.guidance.behaviour import Behaviour
from colibri.autopilot.guidance.landing_detector import Landing, is_below, stands_at_first, watch
from colibri.autopilot.guidance.reference import Reference, at_rest, lead, lead_along, moving_with, still_target
from colibri.autopilot.guidance.sample_grid import Instants
from colibri.autopilot.guidance.tasks.position import HoldTask, TrackTask
from colibri.autopilot.guidance.tasks.task import (
    NOT_STEERED,
    AttitudeMotion,
    FlightTask,
    Motion,
    PlannedMotion,
    Steered,
    TaskContext,
    lifts,
)
from colibri.common.types import Array, Vector
from colibri.mavlink.services.statustext import EMERGENCY, INFO, NOTICE
from colibri.mavlink.wire.refusal import Refusal

TaskFactory: TypeAlias = Callable[[Mode, TaskContext], FlightTask]
_SAVED_BY = {
    Action.HOLD: Event.SAVED_BY_HOLD,
    Action.RETURN: Event.SAVED_BY_RETURN,
    Action.LAND: Event.SAVED_BY_LANDING,
    Action.DESCEND: Event.SAVED_BY_LANDING,
    Action.TERMINATE: Event.TERMINATED,
}


class Guidance(NamedTuple):
    """What the control law is to follow now; neither while the rotors stand or idle.

    Attributes:
        horizon: References of position and yaw.
        attitude: References of attitude and thrust.
        begins: Whether the rotors leave idle now: the control law begins anew.
    """

    horizon: Horizon | None = None
    attitude: AttitudeDemand | None = None
    begins: bool = False


RESTS = Guidance()


class FlightTimes(NamedTuple):
    """When what happened, simulated time; 0 before.

    Attributes:
        armed_us: When the rotors were last armed.
        takeoff_us: When the vehicle last left the ground.
        landing_us: When it last stood again.
        flights: How often the rotors were armed.
    """

    armed_us: int = 0
    takeoff_us: int = 0
    landing_us: int = 0
    flights: int = 0


class Sensed(NamedTuple):
    """What is known at a control sample.

    Attributes:
        now_us: Simulated time.
        vehicle: The vehicle; None as long as nothing is known of it.
        steered: What clients ask for.
        knows_position: Whether the vehicle is known well enough to fly to places.
    """

    now_us: int = 0
    vehicle: VehicleState | None = None
    steered: Steered = NOT_STEERED
    knows_position: bool = True


class PilotRecord(NamedTuple):
    """What a pilot needs to go on after a restart, as plain data; but for the task, what `Pilot` says of each.

    Attributes:
        idles: Whether the rotors stand or idle.
        home_is_chosen: Whether a take-off leaves home where it is.
        motion: Of the reference, (4, 3).
        heading: Of the reference, (2,).
    """

    mode: Mode
    armed: bool
    standing: bool
    idles: bool
    home_enu_m: Vector
    home_yaw_rad: float
    home_is_chosen: bool
    speed_m_s: float | None
    armed_us: int
    takeoff_us: int
    landing_us: int
    flights: int
    ground_m: float
    saving: Action
    motion: Array
    heading: Array


class Pilot:
    """Flies tasks, one mode after another.

    One state machine with many doors: its attributes are its state, all of it in `record`; its methods are what may
    happen to it, and what is asked about it.

    Attributes:
        state: Mode, and whether the rotors may turn.
        behaviour: The numbers to fly by.
        home: Where it took off, or was told to return to.
        standing: Whether it stands on the ground.
        idles: Whether the rotors stand or idle.
        task: What is flown.
        reference: Where the reference stands.
        speed_m_s: Cruise speed that was asked for; None for the parameters'.
        times: Of the last arming, take-off and landing.
        ground_m: Height of where it last stood, z of ENU.
        saving: The failsafe that is flown, until somebody chooses a mode or the rotors stop.
        terminated: Whether a failsafe stopped the rotors in the air.
        rotor_failed: Which rotor has failed, in words; empty if none has. Nothing but landing is possible then.
    """

    def __init__(
        self,
        instants: Instants,
        behaviour: Behaviour,
        make_task: TaskFactory,
        home: Home,
        lines: StatusQueue,
    ) -> None:
        """Begin on the ground, or in the air: see `begin`. What is compiled is loaded here.

        Args:
            instants: At which references are planned, and which of them the control law previews.
            behaviour: The numbers to fly by.
            make_task: Says how each mode begins.
            home: Moved by take-offs and by whoever chooses it.
            lines: Take what a ground station is to know.
        """
        self._instants = instants
        self._make_task = make_task
        self.state = FIRST
        self.behaviour = behaviour
        self.home = home
        self.standing = True
        self.task: FlightTask = HoldTask()
        self.reference: Reference | None = None
        self.speed_m_s: float | None = None
        self.times = FlightTimes()
        self.saving = Action.NONE
        self.terminated = False
        self.rotor_failed = ""
        self.ground_m = 0.0
        self._task_is_chosen = False
        self.idles = True
        self._landing = Landing()
        self._sensed = Sensed()
        self._arming_inputs = ArmingInputs(None, standing=True, charge=1.0, thrust_stick=None)
        self._lines = lines
        self._warm_up()

    def _warm_up(self) -> None:
        """Load what is compiled: a take-off is no time for that."""
        interval_us, samples = self._instants.preview
        motionless = Reference(np.zeros((4, 3)), np.zeros(2))
        lead(motionless, still_target((1.0, 0.0, 0.0), 0.0, samples), self.behaviour.limits, interval_us * 1e-6)

    def begin(self, now_us: int, vehicle: VehicleState, *, mode: Mode | None = None, rests: bool = False) -> None:
        """See the vehicle for the first time: it stands, or it is picked up in flight, in `mode` or in hold.

        Where it is known that it `rests` it stands, however high it seems to be: an estimate of height is not exact.
        """
        self._sensed = self._sensed._replace(now_us=now_us, vehicle=vehicle)
        self.times = FlightTimes(flights=self.times.flights)
        self.standing = self.idles = mode is None and (rests or stands_at_first(vehicle, 0.0))
        self.reference = moving_with(vehicle)
        if self.standing:
            self.home.propose(vehicle.position_enu_m, vehicle.euler[2])
            self.state = FIRST
        else:
            self.state = State(mode or Mode.HOLD, armed=True)
            self._begin_flight()
        self._engage(self.state.mode)

    def record(self) -> PilotRecord:
        """Return what is needed to go on after a restart, but for the task."""
        assert self.reference is not None, "the pilot has seen the vehicle"
        return PilotRecord(
            *self.state,
            self.standing,
            self.idles,
            self.home.position_enu_m,
            self.home.yaw_rad,
            self.home.chosen,
            self.speed_m_s,
            *self.times,
            self.ground_m,
            self.saving,
            *self.reference,
        )

    def resume(
        self,
        now_us: int,
        vehicle: VehicleState,
        record: PilotRecord,
        again: TaskFactory,
        *,
        seamless: bool,
    ) -> None:
        """See the vehicle for the first time since a restart: it goes on as it was.

        The reference goes on where it was if the restart took no time, that is `seamless`, and else from where the
        vehicle is. One that has come down meanwhile stays there. `again` says how a mode goes on.
        """
        self._sensed = self._sensed._replace(now_us=now_us, vehicle=vehicle)
        self.home.resume(record.home_enu_m, record.home_yaw_rad, chosen=record.home_is_chosen)
        self.speed_m_s = record.speed_m_s
        self.times = FlightTimes(record.armed_us, record.takeoff_us, record.landing_us, record.flights)
        self.ground_m = record.ground_m
        came_down = not seamless and not record.standing and stands_at_first(vehicle, record.ground_m)
        self.standing = record.standing or came_down
        self.state = FIRST if came_down else State(record.mode, record.armed)
        self.saving = Action.NONE if came_down else record.saving
        self.idles = record.idles or came_down
        self.reference = Reference(record.motion, record.heading) if seamless else moving_with(vehicle)
        self._take((self._make_task if came_down else again)(self.state.mode, self.context()))
        self._task_is_chosen = not came_down

    def adopt(self, behaviour: Behaviour) -> None:
        """Fly by other numbers from now on; without landing on three rotors, none counts as failed."""
        self.behaviour = behaviour
        if not behaviour.land_on_three:
            self.trust_rotors()

    def sense(
        self, now_us: int, vehicle: VehicleState, steered: Steered = NOT_STEERED, *, knows_position: bool = True
    ) -> None:
        """Take in what a control sample needs.

        Args:
            now_us: Simulated time.
            vehicle: The vehicle.
            steered: What clients ask for.
            knows_position: Whether `vehicle` is known well enough to fly to places.
        """
        self._sensed = Sensed(now_us, vehicle, steered, knows_position)

    @property
    def has_seen(self) -> bool:
        """Whether it has ever known where the vehicle is: on sensors that takes a while."""
        return self._sensed.vehicle is not None

    @property
    def knows_position(self) -> bool:
        """Whether the vehicle knows where it is, as of the last control sample."""
        return self._sensed.knows_position

    def take_stock(self, inputs: ArmingInputs) -> None:
        """Take in what arming is judged by."""
        self._arming_inputs = inputs

    def context(self) -> TaskContext:
        """Return what a task sees now."""
        now_us, vehicle, steered, knows_position = self._sensed
        assert vehicle is not None, "the pilot has seen the vehicle"
        assert self.reference is not None, "the pilot has seen the vehicle"
        interval_us, samples = self._instants.preview
        behaviour = self.behaviour
        speed = behaviour.limits.speed_m_s if self.speed_m_s is None else self.speed_m_s
        speed = min(speed, behaviour.max_speed_m_s)
        if speed != behaviour.limits.speed_m_s:
            behaviour = replace(behaviour, limits=behaviour.limits._replace(speed_m_s=speed))
        interval_s = interval_us * 1e-6
        return TaskContext(
            now_us,
            vehicle,
            self.reference,
            self.home.position_enu_m,
            behaviour,
            interval_s,
            samples,
            steered,
            self.standing,
            self.ground_m,
            blind=self.saving is Action.DESCEND or not knows_position,
        )

    @property
    def flight(self) -> Flight:
        """What failsafes are weighed against."""
        return Flight(self.state.armed, self.standing, self.state.mode, self.saving)

    def refusals(self) -> list[str]:
        """Return why the rotors may not be armed; empty if they may."""
        return refusals(self._arming_inputs) + ([self.rotor_failed] if self.rotor_failed else [])

    def arm(self, missing: Collection[Need], *, force: bool = False) -> Refusal | None:
        """Let the rotors turn; return why not. `missing` are the needs of modes that nothing meets now."""
        if self.state.armed:
            return None
        forced = force and self.has_seen and not self.rotor_failed
        reasons = [] if forced else self.refusals()
        if reasons:
            return Refusal("not armed: " + "; ".join(reasons))
        unmet = [need for need in missing if need is not Need.POSITION]  # a check of its own, and by force
        refusal = self._follow(Event.ARM, "rotors armed", missing=unmet)
        if refusal is None:
            now_us, vehicle, _, _ = self._sensed
            self.times = self.times._replace(armed_us=now_us, flights=self.times.flights + 1)
            self.terminated = False
            if vehicle is not None:
                self.home.propose(vehicle.position_enu_m, vehicle.euler[2])
            if not self._task_is_chosen:
                self._engage(self.state.mode)
        return refusal

    def disarm(self, *, force: bool = False) -> Refusal | None:
        """Stop the rotors; return why not."""
        if not self.state.armed:
            return None
        if not self.standing and not force:
            return Refusal("not disarmed: the vehicle is flying")
        return self._stop_rotors(Event.DISARM, "rotors stopped" if self.standing else "rotors stopped in the air")

    def select(self, mode: Mode, missing: Collection[Need]) -> Refusal | None:
        """Change the mode; return why not. `missing` are the needs of modes that nothing meets now."""
        if mode is self.state.mode and mode is not Mode.HOLD:
            return None
        refusal = self._follow(Event.SELECT, "", mode, missing)
        if refusal is None:
            self.saving = Action.NONE
            self._engage(mode)
        return refusal

    def fly(self, mode: Mode, task: FlightTask, missing: Collection[Need]) -> Refusal | None:
        """Change to `mode` and fly `task` in it, now or once the rotors are armed; return why not.

        `missing` are the needs of modes that nothing meets now; where a circle leads, the task says.
        """
        refusal = self._follow(Event.SELECT, "", mode, [need for need in missing if need is not Need.CIRCLE])
        if refusal is None:
            self.saving = Action.NONE
            self.task, self._task_is_chosen = task, True
        return refusal

    def save(self, action: Action) -> None:
        """Do what a failsafe says, whatever is flown: it has been weighed against that, and been said."""
        if not self.state.armed:
            return
        if action is Action.TERMINATE:
            self.terminated = not self.standing
            self._stop_rotors(Event.TERMINATED, "")
            return
        self.saving = action
        self._follow(_SAVED_BY[action], "")
        self._engage(self.state.mode)

    def fly_at(self, speed_m_s: float | None) -> None:
        """Cruise at another speed for this flight; None for the parameters'."""
        self.speed_m_s = speed_m_s

    def happened(self, event: Event) -> None:
        """Tell of an event that may change the mode: what is finished."""
        before = self.state
        stays = event in (Event.ARRIVED, Event.FINISHED)  # where the task that ends has led
        if self._follow(event, f"{event}: {{mode}}") is None and self.state.mode is not before.mode and not stays:
            self._engage(self.state.mode)

    def lose_rotor(self, rotor: int) -> None:
        """Choose nothing any more: rotor 0..3 has failed, and the failsafe of that lands."""
        self.rotor_failed = f"rotor {rotor + 1} failed"
        self.say(EMERGENCY, f"{self.rotor_failed}: landing on three rotors")

    def trust_rotors(self) -> None:
        """Take all rotors for whole again."""
        self.rotor_failed = ""

    def touch_down(self) -> None:
        """Stand, and stop the rotors: something else than the reference tells of the ground."""
        self._stand()
        self._stop_rotors(Event.TOUCHED_DOWN, f"{Event.TOUCHED_DOWN}, rotors stopped")

    def step(self) -> Guidance:
        """Return what to follow from now on. Called once a control sample."""
        if not self.state.armed:
            self._rest()
            return RESTS
        context = self.context()
        wanted = self.task.update(context)
        if isinstance(self.task, MissionTask) and self.task.says_return:
            self.happened(Event.RETURN_ITEM)
        if self.standing:
            if not (wanted.lifts if isinstance(wanted, AttitudeMotion) else lifts(wanted.target, context.state)):
                self._idle()
                return RESTS
            self._begin_flight()
        begins, self.idles = self.idles, False
        guidance = (
            self._attitude_guidance(wanted, begins)
            if isinstance(wanted, AttitudeMotion)
            else self._move(context, wanted, begins)
        )
        if self.task.arrived(context):
            self._arrive()
        return guidance

    def say(self, severity: int, text: str) -> None:
        """Add a line for the ground station."""
        self._lines.say(severity, text)

    def _move(self, context: TaskContext, wanted: Motion | PlannedMotion, begins: bool) -> Guidance:
        horizon = self._lead(context, wanted)
        self._watch_ground(context.state, sinks=is_below(context.reference, context.state))
        return Guidance(horizon=horizon, begins=begins)

    def _lead(self, context: TaskContext, wanted: Motion | PlannedMotion) -> Horizon:
        """Move the reference on, and return what the control law previews of it."""
        reference, limits, interval_s = context.reference, wanted.limits, context.interval_s
        if isinstance(wanted, PlannedMotion):
            horizon, self.reference = lead_along(reference, wanted.horizon, limits, interval_s)
            if wanted.for_law is not None and horizon.position_enu_m is wanted.horizon.position_enu_m:
                turned = horizon.yaw_rad[0] - wanted.horizon.yaw_rad[0]
                return wanted.for_law._replace(yaw_rad=wanted.for_law.yaw_rad + turned)
        else:
            horizon, self.reference = lead(reference, wanted.target, limits, interval_s)
        return self._instants.for_law(horizon)

    def _attitude_guidance(self, wanted: AttitudeMotion, begins: bool) -> Guidance:
        vehicle = self._sensed.vehicle
        assert vehicle is not None, "the pilot has seen the vehicle"
        self.reference = wanted.reference
        self._watch_ground(vehicle, sinks=wanted.sinks, drifts=wanted.drifts)
        return Guidance(attitude=wanted.demand, begins=begins)

    def _rest(self) -> None:
        """Lie, or fall, with the rotors standing still or idle."""
        now_us, vehicle, _, _ = self._sensed
        assert vehicle is not None, "the pilot has seen the vehicle"
        self.idles = True
        self.reference = at_rest(vehicle)
        self._landing, lies = watch(self._landing, now_us, vehicle, sinks=True)
        self.standing = self.standing or lies
        if self.standing:
            self.ground_m = vehicle.position_enu_m[2]

    def _idle(self) -> None:
        """Stand with idling rotors; not for ever."""
        self._rest()
        times = self.times
        on_ground_us = self._sensed.now_us - max(times.armed_us, times.landing_us)
        landed = times.landing_us > times.armed_us
        behaviour = self.behaviour
        allowed_s = behaviour.disarm_after_landing_s if landed else behaviour.disarm_on_ground_s
        if allowed_s > 0.0 and on_ground_us >= allowed_s * 1e6:
            event = Event.TOUCHED_DOWN if landed else Event.LEFT_STANDING
            self._stop_rotors(event, f"{event}, rotors stopped")

    def _stop_rotors(self, event: Event, text: str) -> Refusal | None:
        """Stop the rotors, and forget what was asked for this flight alone."""
        refusal = self._follow(event, text)
        if refusal is None:
            self.speed_m_s = None
            self.saving = Action.NONE
            self._landing = Landing()
            self._engage(self.state.mode)
        return refusal

    def _begin_flight(self) -> None:
        self.standing = False
        self._landing = Landing()
        self.times = self.times._replace(takeoff_us=self._sensed.now_us)
        self.say(INFO, "take-off")

    def _watch_ground(self, vehicle: VehicleState, *, sinks: bool, drifts: bool = False) -> None:
        self._landing, stands = watch(self._landing, self._sensed.now_us, vehicle, sinks, drifts=drifts)
        if stands:
            self._stand()

    def _stand(self) -> None:
        self.standing = True
        self.times = self.times._replace(landing_us=self._sensed.now_us)
        self.say(NOTICE, "landing detected")

    def _arrive(self) -> None:
        if self.state.mode is Mode.TAKEOFF:
            self.happened(Event.ARRIVED)
        elif self.state.mode in (Mode.MISSION, Mode.TRACK):
            self.happened(Event.FINISHED)

    def _engage(self, mode: Mode) -> None:
        if self.reference is not None:
            self._take(self._make_task(mode, self.context()))
            self._task_is_chosen = False

    def _take(self, task: FlightTask) -> None:
        """Fly a task from now on; one that was begun in mid-flight says where the reference is."""
        self.task = task
        if isinstance(task, TrackTask) and task.start is not None:
            self.reference = task.start

    def _follow(
        self, event: Event, text: str, selected: Mode | None = None, missing: Collection[Need] = ()
    ) -> Refusal | None:
        if event is Event.SELECT and self.state.armed and self.rotor_failed:
            return Refusal(f"{selected} refused: {self.rotor_failed}")
        after = next_state(self.state, event, selected, missing)
        if isinstance(after, Refusal):
            return after
        if after != self.state and text:
            self.say(INFO, text.format(mode=after.mode))
        self.state = after
        return None
