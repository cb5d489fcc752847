"""The whole vehicle as a pure composition: frames of the plant and datagrams of ground stations in, answers out."""

from collections.abc import Iterable

from colibri.autopilot.commander.fence import Fence
from colibri.autopilot.commander.home import Home
from colibri.autopilot.commander.missions import Missions
from colibri.autopilot.commander.mode_tasks import ModeTasks
from colibri.autopilot.commander.pilot import RESTS, Guidance, Pilot
from colibri.autopilot.commander.rules.arming import ArmingInputs, battery_fault
from colibri.autopilot.commander.rules.failsafe_conditions import NEVER_US, FailsafeInputs
from colibri.autopilot.commander.rules.failsafe_table import Action, Condition
from colibri.autopilot.commander.rules.modes import MANUAL, Mode
from colibri.autopilot.commander.status_queue import StatusQueue
from colibri.autopilot.commander.supervisor import Supervisor
from colibri.autopilot.control.interface import Clock, Decision, VehicleState
from colibri.autopilot.control.loop import ControlLoop
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.control.rotor_loss.rotor_loss import RotorLoss
from colibri.autopilot.core.checkpoint import Checkpoint, Checkpointer, History, fingerprint_of, goes_on
from colibri.autopilot.core.solve_time import SolveTime
from colibri.autopilot.core.step import STILL, Received, Step, follows, nothing_known
from colibri.autopilot.estimation.health import HealthWatch, not_known
from colibri.autopilot.estimation.state_source import Estimator, StateSource
from colibri.autopilot.ground.battery_monitor import BatteryMonitor
from colibri.autopilot.ground.snapshots import SnapshotBuilder
from colibri.autopilot.ground.stations import Stations, StationSettings
from colibri.autopilot.guidance.attitude_reference import AttitudeReference, attitude_limits
from colibri.autopilot.guidance.sample_grid import instants
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.autopilot.parameters.definitions import Numbers, behaviour, definitions
from colibri.autopilot.parameters.retuning import Tuning, builder
from colibri.autopilot.parameters.subscription import Subscribers
from colibri.mavlink.hil.plant_status import NOTHING, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.parameters.store import Parameters, Value
from colibri.mavlink.services.statustext import INFO, WARNING
from colibri.mavlink.telemetry.snapshot import BatteryState
from colibri.plant.vehicle.description import Vehicle

FALLS = "restarted in the air, knowing nothing: found falling"
_EVER_US = 10**15


class Copter:
    """A vehicle that ground stations fly.

    It puts the parts together and hands values from one to the next: its attributes are the parts, and what of one
    frame the next one needs.

    Attributes:
        frame_interval_us: How often it wants a frame.
        pilot: Decides what is flown.
        parameters: All numbers that can be changed.
        stations: What ground stations see and say.
        power: The battery, as far as the autopilot knows.
        rotor_loss: Notices when a rotor is lost, and lands on the others.
        solve_time_s: Of the last QP.
        supervisor: Has the pilot do what the failsafes say.
        samples: How many control samples ground stations were told of.
        resumed: What goes on of a flight in which an autopilot was killed, in words; empty where none does.
    """

    def __init__(
        self,
        profile: Profile,
        vehicle: Vehicle,
        settings: StationSettings,
        clock: Clock,
        *,
        values: dict[str, Value] | None = None,
        first: Track | None = None,
        estimator: Estimator | None = None,
        history: History | None = None,
    ) -> None:
        """Fly `vehicle` by `profile`; `clock` only measures, it decides nothing.

        Args:
            profile: The control law and its numbers.
            vehicle: That it controls.
            settings: Towards ground stations.
            clock: Seconds.
            values: Of parameters that were changed before.
            first: A track that is flown from time 0 on, the vehicle being in the air; None: it stands, or is picked
                up in hold.
            estimator: Makes what turns frames of sensors into states; None: frames are states.
            history: Of a flight in which an autopilot was killed; it goes on if the first frame is of the same flight.

        Raises:
            ControllerError: The profile's control law cannot be used.
            ProfileError: Its table is wrong.
            SolverError: Its solver cannot be used.
            ImpossibleError: The values of the parameters make an impossible vehicle.
        """
        numbers = Numbers(profile, vehicle)
        self.parameters = Parameters(definitions(profile, vehicle, settings.system_id))
        self.parameters.load(values or {})
        flown, believed = numbers.applied(self.parameters.values)
        self._loop = ControlLoop(flown, believed, clock)
        self._start_speed = vehicle.speed_from_rpm(profile.simulation.rotor_speed_rpm)
        self._clock = clock
        self.frame_interval_us = self._loop.frame_interval_us
        self._state_source = StateSource(estimator, self.frame_interval_us)
        self._health = HealthWatch()
        self._interval_s = self._loop.control_interval_us * 1e-6
        flies_by = behaviour(self.parameters)
        self._attitude: AttitudeReference | None = None
        if self._loop.takes_attitude:
            self._attitude = AttitudeReference(believed, self._loop.preview, attitude_limits(flies_by))
        planned_at = instants(self._loop.preview, self._loop.control_interval_us)
        home, lines = Home(settings.origin), StatusQueue()
        fence = Fence(home, flies_by)
        missions = Missions(home, fence, lines, flies_by)
        self._tasks = ModeTasks(
            missions, self._attitude, believed, self._loop.preview, planned_at, profile.references, first
        )
        self.pilot = Pilot(planned_at, flies_by, self._tasks.begin, home, lines)
        self.stations = Stations(
            settings,
            self.pilot,
            missions,
            fence,
            lines,
            self.parameters,
            takes_attitude=self._attitude is not None,
        )
        tuning = Tuning(numbers, builder(profile.controller, clock), self._loop, self.stations.warn)
        self.parameters.ask(tuning.prepare)
        self.power = BatteryMonitor(believed)
        self.supervisor = Supervisor(self.parameters, lines)
        self._missed_us: int | None = None
        self._waiting_us: int | None = None
        self._solving = SolveTime(self._loop.control_interval_us)
        self._plant_status = NOTHING
        self._sent = STILL
        self.rotor_loss = RotorLoss(believed, self._loop.control_interval_us)
        self.rotor_loss.obey(flies_by)
        self._snapshots = SnapshotBuilder(believed, self._interval_s, self._loop.plan_columns)
        self._subscribers = self._subscribe()
        parts = (
            self._loop,
            self._state_source,
            self.pilot,
            self.stations,
            self.power,
            self.rotor_loss,
            self.supervisor,
        )
        self._checkpointer = Checkpointer(fingerprint_of(profile, vehicle), *parts)
        self._history = history
        self._wakes = history is not None
        self._resumed_us: int | None = None
        self.samples, self.resumed = 0, ""
        self._time_us: int | None = None
        self._decision: Decision | None = None
        self._sample: tuple[int, VehicleState, Guidance, Decision | None] | None = None
        self._step_time_s = 0.0
        self.solve_time_s = 0.0

    def _subscribe(self) -> Subscribers:
        """Return who is handed changes of the parameters."""
        attitude, stations = self._attitude, self.stations
        return Subscribers(
            parameters=(self.supervisor.adopt,),
            behaviour=(
                self.pilot.adopt,
                stations.missions.adopt,
                self.rotor_loss.obey,
                *(() if attitude is None else (attitude.obey,)),
            ),
            law=(self._loop.adopt,),
            vehicle=(
                self._tasks.adopt,
                self.rotor_loss.adopt,
                self._snapshots.adopt,
                *(() if attitude is None else (attitude.adopt,)),
            ),
        )

    @property
    def deadlines_missed(self) -> int:
        """How many decisions have taken longer than a control interval, in simulated time."""
        return self._solving.missed

    def step(self, frame: Frame, plant_status: PlantStatus = NOTHING) -> Step:
        """Answer a frame of the plant and what it tells beside it.

        On sensors nothing is known, and nobody obeyed, before the first estimate.

        Raises:
            DecisionError: The control law gave what no rotor can follow.
        """
        started_s = self._clock()
        self._plant_status = plant_status
        if plant_status.battery is not None:
            self._loop.know_charge(plant_status.battery.used_ah)
            self.power.receive(plant_status.battery)
        if self._wakes:
            self._wake(frame.time_us)
        due = self._loop.is_due(frame.time_us)
        goes_on = follows(frame.time_us, self._time_us, self.frame_interval_us)
        known = self._state_source.state(frame, asked=due or not goes_on)
        if known is None:
            self._waiting_us = frame.time_us
            if self._time_us is not None:  # another flight, of which nothing is known yet
                self.stations.reboot()
            return nothing_known(frame.time_us, self._clock() - started_s)
        if not goes_on:
            self._missed_us = self._time_us if self._missed_us is None else self._missed_us
            self._begin(known)
        self._time_us = frame.time_us
        decision = None
        if due:
            state = self._loop.state(known)
            self._watch_rotors(state)
            self._sense(frame.time_us, state)
            guidance = self.pilot.step()
            decision = self._decide(frame.time_us, state, guidance)
            if not self._solving.busy(frame.time_us) or decision is not None:
                self._decision = decision
            self._sample = (frame.time_us, state, guidance, self._decision)
        self._sent = self._solving.controls(frame.time_us)
        command = ActuatorCommand(frame.time_us, self._sent, armed=self.pilot.state.armed)
        self._step_time_s = self._clock() - started_s
        estimate = self._state_source.estimate if due else None
        return Step(command, decision, self._step_time_s, estimate, self.stations.failures.take())

    def serve(self, inbox: Iterable[Received]) -> list[Outgoing]:
        """Hear ground stations, and return what to send them; after each `step`, while the plant integrates."""
        now_us = self._time_us
        if now_us is None:
            return self._put_off(inbox)
        if self._sample is not None:
            sample, self._sample = self._sample, None
            self._report(*sample)
        self.stations.hear_plant(self._plant_status, now_us)
        self._plant_status = NOTHING
        hub = self.stations.hub
        for datagram, link, address, loopback in inbox:
            hub.receive(datagram, link, address, now_us, loopback=loopback)
        self._subscribers.adopt(self.parameters)
        return self.stations.poll(now_us)

    def _put_off(self, inbox: Iterable[Received]) -> list[Outgoing]:
        """Deny what is commanded: nothing is known of the vehicle yet."""
        if self._waiting_us is None:
            return []
        self.stations.wait("not ready: attitude and position are not known yet")
        for datagram, link, address, loopback in inbox:
            self.stations.hub.receive(datagram, link, address, self._waiting_us, loopback=loopback)
        self.stations.wait("")
        return self.stations.take_outbox()

    def record(self) -> Checkpoint | None:
        """Return what the flight needs to go on after a restart; None as long as nothing is known of it."""
        return None if self._time_us is None else self._checkpointer.record(self._time_us)

    def _wake(self, time_us: int) -> None:
        """Have the estimator go on before it sees the first frame."""
        self._wakes = False
        if self._history is not None and self._history.checkpoint.state_source:
            self._state_source.resume(self._history.checkpoint.state_source, time_us)

    def _resume(self, history: History, frame: StateFrame) -> None:
        """Go on with the flight in which the autopilot was killed."""
        pilot, checkpoint = self.pilot, history.checkpoint
        if checkpoint.pilot.mode is not Mode.TRACK or checkpoint.task.began_us != 0:
            self._tasks.forget_first()
        self._resumed_us = frame.time_us
        self._checkpointer.resume(history, frame, self._tasks.again)
        self._sent = self._loop.controls if pilot.state.armed and not pilot.idles else STILL
        self._solving.at_once(self._sent)
        self.rotor_loss.begin(self._sent)
        self.stations.say(INFO, self.stations.banner())
        if not pilot.state.armed:
            return
        if self._state_source.estimate is not None and not self._state_source.rests:
            pilot.say(WARNING, FALLS)
        self.resumed = goes_on(pilot.state.mode, self.stations.missions.progress().seq)
        pilot.say(WARNING, self.resumed)

    def _begin(self, frame: StateFrame) -> None:
        """See the vehicle for the first time, or anew after frames were missed."""
        history, self._history = self._history, None
        if history is not None and history.checkpoint.is_followed_by(frame.time_us):
            self._resume(history, frame)
            return
        loop, hover_speed = self._loop, self._loop.vehicle.hover_speed
        if self._time_us is not None and frame.time_us > self._time_us:
            loop.begin(hover_speed, loop.state(frame).euler[2])
            self.rotor_loss.begin(loop.controls)
            return
        if self._time_us is not None:  # another flight: nothing that any service remembers is of any use
            self.stations.reboot()
        speed = self._start_speed if frame.time_us == 0 else hover_speed
        rests = self._state_source.rests
        if rests:
            speed = loop.vehicle.rotors.idle_speed
        loop.begin(speed, self._tasks.first_yaw_rad)
        mode = Mode.TRACK if self._tasks.is_first else None
        self.pilot.begin(frame.time_us, loop.state(frame), mode=mode, rests=rests)
        self._sent = STILL if self.pilot.standing else loop.controls
        self._solving.at_once(self._sent)
        self.rotor_loss.forget()
        self.rotor_loss.begin(self._sent)
        self.pilot.trust_rotors()
        if self._state_source.estimate is not None and not rests:
            self.pilot.say(WARNING, FALLS)
        self.stations.say(INFO, self.stations.banner())

    def _sense(self, now_us: int, state: VehicleState) -> None:
        """Take in what steers the vehicle, and what has ceased to."""
        pilot, supervisor = self.pilot, self.supervisor
        knows_position = supervisor.knows_position(self._state_source.estimate)
        pilot.sense(now_us, state, self.stations.needs.steered(now_us), knows_position=knows_position)
        action = supervisor.step(self._failsafe_inputs(now_us, state), pilot.flight)
        if action is not Action.NONE:
            pilot.save(action)
        self._missed_us = None

    def _failsafe_inputs(self, now_us: int, state: VehicleState) -> FailsafeInputs:
        """Return what the failsafes' conditions are judged by."""
        pilot, stations = self.pilot, self.stations
        sticks = stations.manual.latest(now_us, _EVER_US)
        return FailsafeInputs(
            now_us=now_us,
            missed_us=self._missed_us,
            state=state,
            mode=pilot.state.mode,
            standing=pilot.standing,
            estimate=self._state_source.estimate,
            setpoint=stations.offboard.latest(now_us, _EVER_US),
            sticks_us=None if sticks is None else sticks.time_us,
            listening_us=NEVER_US if self._resumed_us is None else self._resumed_us,
            station_us=stations.station_us,
            battery=self.power.state(),
            fence=stations.fence.margin_m if stations.fence.exists else None,
            decided=None if self._decision is None else self._decision.diagnostics,
            late=pilot.behaviour.solve_time_s * 1e6 > self._loop.control_interval_us,
            rotor_lost=self.rotor_loss.lost,
            pace=pilot.behaviour.limits,
        )

    def _watch_rotors(self, state: VehicleState) -> None:
        """Notice whether a rotor is lost: then there is but one way to fly."""
        pilot, estimate = self.pilot, self._state_source.estimate
        if not pilot.state.armed:
            self.rotor_loss.end()
        feels = estimate is None or (estimate.health.gyroscope and estimate.health.accelerometer)
        airborne = feels and pilot.state.armed and not pilot.standing
        charge_ah = self.power.charge_ah
        if self.rotor_loss.look(state, self._sent, charge_ah, airborne=airborne, ground_m=pilot.ground_m):
            assert self.rotor_loss.lost is not None, "what is lost has a number"
            pilot.lose_rotor(self.rotor_loss.lost)

    def _take_stock(self, state: VehicleState) -> None:
        """Take in what orders of ground stations are judged by."""
        pilot = self.pilot
        sticks = pilot.context().steered.sticks
        thrust = sticks.thrust if sticks is not None and pilot.state.mode in MANUAL else None
        outside = self.stations.fence.breach(state.position_enu_m, self._time_us or 0)
        estimate = self._state_source.estimate
        unknown = not_known(estimate.health) if estimate is not None else ""
        inputs = ArmingInputs(state, pilot.standing, self.power.left, thrust, outside, unknown, self._battery_fault())
        pilot.take_stock(inputs)

    def _battery_fault(self) -> str:
        """Return why nobody may take off on the battery, apart from its charge; empty if one may."""
        battery, model = self.power.state(), self._loop.vehicle.battery
        if battery is None or model is None:
            return ""
        if any(map(self.supervisor.holds, (Condition.BATTERY_EMERGENCY, Condition.BATTERY_CRITICAL))):
            return f"battery critical: {battery.voltage_v:.1f} V"
        return battery_fault(battery.voltage_v, model.empty_voltage_v, model.full_voltage_v)

    def _decide(self, now_us: int, state: VehicleState, guidance: Guidance) -> Decision | None:
        loop = self._loop
        if self.rotor_loss.flies:
            controls, decision = self.rotor_loss.decide(state, self.power.charge_ah)
            self._solving.at_once(controls)
            if self.rotor_loss.landed:
                self.pilot.touch_down()
            return decision
        if guidance.begins:
            loop.begin(loop.vehicle.rotors.idle_speed, state.euler[2], afresh=False)
        elif guidance is not RESTS and self._solving.busy(now_us):
            return None
        if guidance.horizon is not None:
            decision = loop.decide(now_us, state, guidance.horizon)
        elif guidance.attitude is not None:
            decision = loop.decide_attitude(now_us, state, guidance.attitude)
        else:
            self._solving.at_once(STILL)
            return None
        self._solving.decided(loop.controls, now_us, round(self.pilot.behaviour.solve_time_s * 1e6))
        self.solve_time_s = decision.diagnostics.solve_time_s
        return decision

    def _report(self, now_us: int, state: VehicleState, guidance: Guidance, decision: Decision | None) -> None:
        pilot, stations = self.pilot, self.stations
        self.samples += 1
        self._take_stock(state)
        if self._state_source.estimate is not None:
            for severity, line in self._health.lines(self._state_source.estimate.health):
                stations.say(severity, line)
        idle = self._loop.vehicle.rotors.idle_speed / self._loop.vehicle.rotors.max_speed
        minimum = idle if pilot.state.armed else 0.0
        c1, c2, c3, c4 = (max(control, minimum) for control in self._solving.controls(now_us))
        self.power.run((c1, c2, c3, c4), self._interval_s)
        stations.missions.watch_mode(pilot.state.mode)
        stations.update(
            self._snapshots.take(
                now_us,
                state,
                pilot,
                guidance,
                decision,
                self._step_time_s,
                (c1, c2, c3, c4),
                self._battery(),
                stations,
                self._state_source,
            )
        )

    def _battery(self) -> BatteryState | None:
        """Return the battery as it is told."""
        battery = self.power.state()
        return None if battery is None else battery._replace(charge_state=self.supervisor.charge_state)
