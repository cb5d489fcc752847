"""The whole vehicle as a pure composition: frames of the plant and datagrams of ground stations in, answers out."""

from collections.abc import Iterable

from colibri.autopilot.control.interface import Clock, VehicleState
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.checkpoint import Checkpoint, Checkpointer, History, fingerprint_of
from colibri.autopilot.core.defence import errors
from colibri.autopilot.core.defence.state_estimates import StateEstimates
from colibri.autopilot.core.flight_start import FlightStart
from colibri.autopilot.core.flying import Flying
from colibri.autopilot.core.parts import parts_of
from colibri.autopilot.core.report import Reporter, Sample
from colibri.autopilot.core.step import Received, Step, follows, nothing_known
from colibri.autopilot.core.supervision import Supervision
from colibri.autopilot.estimation.state_source import NewEstimator, estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.plant_status import NOTHING, PlantBattery, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.parameters.store import Value
from colibri.plant.vehicle.description import Vehicle


class Copter:
    """A vehicle that ground stations fly, whatever raises: see `colibri.autopilot.core.defence`.

    Attributes:
        frame_interval_us: How often it wants a frame.
        parts: Of the vehicle.
        pilot: Decides what is flown.
        parameters: All numbers that can be changed.
        stations: Serves ground stations.
        defence: Catches exceptions in flight.
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
        estimator: NewEstimator | None = None,
        history: History | None = None,
        strict: bool = False,
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
            estimator: Makes what turns frames of sensors into states; None: the one for the settings' feedback.
            history: Of a flight in which an autopilot was killed; it goes on if the first frame is of the same flight.
            strict: Whether what a part of it raises in flight is raised, rather than replaced.

        Raises:
            ControllerError: The profile's control law cannot be used.
            ProfileError: Its table is wrong.
            SolverError: Its solver cannot be used.
            ImpossibleError: The values of the parameters make an impossible vehicle.
            VehicleError: The feedback is of sensors that the vehicle has not.
        """
        estimator = estimator or estimator_for(settings.feedback, vehicle, settings.origin)
        self.parts = parts = parts_of(profile, vehicle, settings, clock, values, first, estimator, strict)
        self.pilot, self.parameters, self.stations = parts.pilot, parts.parameters, parts.stations
        self.frame_interval_us = parts.loop.frame_interval_us
        self._clock = clock
        self._checkpointer = Checkpointer(fingerprint_of(profile, vehicle), parts)
        self.defence = parts.defence
        self.defence.keep(lambda: None if self._time_us is None else self._checkpointer.record(self._time_us))
        self._estimates = StateEstimates(parts.state_source, self.defence, vehicle.gravity_m_s2)
        self._supervision = Supervision(parts, self.defence)
        self._flying = Flying(parts, self._supervision, self.defence)
        start_speed = vehicle.speed_from_rpm(profile.simulation.rotor_speed_rpm)
        self._start = FlightStart(parts, self._supervision, self._checkpointer, history, start_speed)
        self._reporter = Reporter(parts)
        self._sample: Sample | None = None
        self._plant_status = NOTHING
        self._time_us: int | None = None
        self._waiting_us: int | None = None

    @property
    def samples(self) -> int:
        """How many control samples were reported to ground stations."""
        return self._reporter.samples

    @property
    def resumed(self) -> str:
        """What goes on of a flight in which an autopilot was killed, in words; empty where none does."""
        return self._start.resumed

    def step(self, frame: Frame, plant_status: PlantStatus = NOTHING) -> Step:
        """Answer a frame of the plant and the plant status beside it.

        On sensors the rotors stand, and commands are denied, before the first estimate.

        Raises:
            Exception: What a part raises, if strict.
        """
        started_s = self._clock()
        parts, now_us = self.parts, frame.time_us
        self._plant_status, self.defence.frame = plant_status, frame
        if plant_status.battery is not None:
            self._know_charge(plant_status.battery)
        if plant_status.delay_us is not None:
            parts.delay.measure(plant_status.delay_us)
        self._wake(now_us)
        due = parts.loop.is_due(now_us)
        goes_on = follows(now_us, self._time_us, self.frame_interval_us)
        known = self._estimates.state(frame, asked=due or not goes_on)
        if known is None:
            self._waiting_us = now_us
            if self._time_us is not None:  # another flight, of which nothing is known yet
                parts.stations.system.reboot()
            return nothing_known(now_us, self._clock() - started_s)
        if not goes_on:
            self._begin(known)
        self._time_us = now_us
        decision = estimate = guidance = None
        if due:
            try:
                state = parts.loop.state(known)
                guidance, decision = self._flying.step(now_us, self._ahead(known, state), blind=self._estimates.blind)
            except Exception as error:
                self.defence.caught(errors.STEP, error)
                decision = self._flying.rescue(now_us, known)
            estimate = parts.state_source.estimate
        command = ActuatorCommand(now_us, parts.actuation.send(now_us), armed=self._flying.armed)
        parts.delay.sent(command)
        duration_s = self._clock() - started_s
        if guidance is not None:
            self._sample = Sample(now_us, state, guidance, parts.actuation.decision, duration_s)
        return Step(command, decision, duration_s, estimate, self._faults(), delay_us=parts.delay.delay_us)

    def _ahead(self, known: StateFrame, state: VehicleState) -> VehicleState:
        """Return the state at which a command of now takes effect; that of now where nothing delays it."""
        parts, standing = self.parts, self.pilot.ground.standing
        if parts.delay.delay_us == 0 or errors.DELAY in self.defence.off:
            return state
        try:
            ahead = parts.delay.ahead(known, parts.battery.charge_ah, standing=standing)
            return parts.loop.state(ahead)
        except Exception as error:
            self.defence.caught(errors.DELAY, error)
            return state

    def _know_charge(self, battery: PlantBattery) -> None:
        if errors.BATTERY in self.defence.off:
            return
        try:
            self.parts.loop.know_charge(battery.used_ah)
            self.parts.battery.receive(battery)
        except Exception as error:
            self.defence.caught(errors.BATTERY, error)

    def _wake(self, now_us: int) -> None:
        try:
            self._start.wake(now_us)
        except Exception as error:
            self.defence.caught(errors.RESTART, error)

    def _begin(self, known: StateFrame) -> None:
        """Start a flight; where the start raises, once more without the past, and then by the last resort."""
        for part in (errors.RESTART, errors.START):
            try:
                self._start.begin(known, self._time_us)
                self.parts.delay.begin(self.parts.actuation.sent)
                return
            except Exception as error:
                self.defence.caught(part, error)
        self._flying.descend(known.time_us)

    def _faults(self) -> tuple[Fault, ...]:
        try:
            return self.parts.stations.failures.take()
        except Exception as error:
            self.defence.caught(errors.FAULTS, error)
            return ()

    def serve(self, inbox: Iterable[Received]) -> list[Outgoing]:
        """Serve ground stations, and return what to send them; after each `step`, while the plant integrates."""
        now_us = self._time_us
        if now_us is None:
            return self._put_off(inbox)
        self._report()
        try:
            self.stations.receive_status(self._plant_status, now_us)
        except Exception as error:
            self.defence.caught(errors.STATIONS, error)
        self._plant_status = NOTHING
        self._hear(inbox, now_us)
        try:
            self.parts.subscribers.adopt(self.parameters)
        except Exception as error:
            self.defence.caught(errors.PARAMETERS, error)
            self.parts.subscribers.keep(self.parameters)
        return self.stations.poll(now_us)

    def _report(self) -> None:
        """Report a control sample; where that raises, ground stations read the mode, and old values beside it."""
        sample, self._sample = self._sample, None
        if sample is None:
            return
        if errors.TELEMETRY not in self.defence.off:
            try:
                self._reporter.report(sample)
                return
            except Exception as error:
                self.defence.caught(errors.TELEMETRY, error)
        self.stations.go_on()

    def _hear(self, inbox: Iterable[Received], now_us: int) -> None:
        """Give the hub what came; a datagram that it cannot bear is dropped."""
        arriving = iter(inbox)
        while True:
            try:
                received = next(arriving, None)
                if received is None:
                    return
                datagram, link, address, loopback = received
                self.stations.hub.receive(datagram, link, address, now_us, loopback=loopback)
            except Exception as error:
                self.defence.caught(errors.DATAGRAM, error)

    def _put_off(self, inbox: Iterable[Received]) -> list[Outgoing]:
        """Deny commands while nothing is known of the vehicle yet."""
        if self._waiting_us is None:
            return []
        self.stations.refuse_commands("not ready: attitude and position are not known yet")
        self._hear(inbox, self._waiting_us)
        self.stations.refuse_commands("")
        return self.stations.take_outbox()

    def record(self) -> Checkpoint | None:
        """Return the checkpoint for a restart; None as long as nothing is known of the vehicle, or where it raises."""
        if self._time_us is None or errors.CHECKPOINT in self.defence.off:
            return None
        try:
            return self._checkpointer.record(self._time_us)
        except Exception as error:
            self.defence.caught(errors.CHECKPOINT, error)
            return None
