"""The whole vehicle as a pure composition: frames of the plant and datagrams of ground stations in, answers out."""

from collections.abc import Iterable

from colibri.autopilot.control.interface import Clock
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.checkpoint import Checkpoint, Checkpointer, History, fingerprint_of
from colibri.autopilot.core.flight_start import FlightStart
from colibri.autopilot.core.parts import parts_of
from colibri.autopilot.core.report import Reporter, Sample
from colibri.autopilot.core.step import Received, Step, follows, nothing_known
from colibri.autopilot.core.supervision import Supervision
from colibri.autopilot.estimation.state_source import NewEstimator, estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.mavlink.hil.plant_status import NOTHING, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.parameters.store import Value
from colibri.plant.vehicle.description import Vehicle


class Copter:
    """A vehicle that ground stations fly.

    Attributes:
        frame_interval_us: How often it wants a frame.
        parts: Of the vehicle.
        pilot: Decides what is flown.
        parameters: All numbers that can be changed.
        stations: Serves ground stations.
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

        Raises:
            ControllerError: The profile's control law cannot be used.
            ProfileError: Its table is wrong.
            SolverError: Its solver cannot be used.
            ImpossibleError: The values of the parameters make an impossible vehicle.
            VehicleError: The feedback is of sensors that the vehicle has not.
        """
        estimator = estimator or estimator_for(settings.feedback, vehicle, settings.origin)
        self.parts = parts = parts_of(profile, vehicle, settings, clock, values, first, estimator)
        self.pilot, self.parameters, self.stations = parts.pilot, parts.parameters, parts.stations
        self.frame_interval_us = parts.loop.frame_interval_us
        self._clock = clock
        self._checkpointer = Checkpointer(fingerprint_of(profile, vehicle), parts)
        self._supervision = Supervision(parts)
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
            DecisionError: The control law gave what no rotor can follow.
        """
        started_s = self._clock()
        parts, now_us = self.parts, frame.time_us
        self._plant_status = plant_status
        if plant_status.battery is not None:
            parts.loop.know_charge(plant_status.battery.used_ah)
            parts.battery.receive(plant_status.battery)
        self._start.wake(now_us)
        due = parts.loop.is_due(now_us)
        goes_on = follows(now_us, self._time_us, self.frame_interval_us)
        known = parts.state_source.state(frame, asked=due or not goes_on)
        if known is None:
            self._waiting_us = now_us
            if self._time_us is not None:  # another flight, of which nothing is known yet
                parts.stations.system.reboot()
            return nothing_known(now_us, self._clock() - started_s)
        if not goes_on:
            self._start.begin(known, self._time_us)
        self._time_us = now_us
        decision = estimate = guidance = None
        if due:
            state = parts.loop.state(known)
            self._supervision.step(now_us, state)
            guidance = self.pilot.step()
            solve_time_s = self.pilot.behaviour.solve_time_s
            decision = parts.actuation.decide(now_us, state, guidance, parts.battery.charge_ah, solve_time_s)
            if parts.rotor_loss.landed and self.pilot.state.armed:
                self.pilot.touch_down()
            estimate = parts.state_source.estimate
        command = ActuatorCommand(now_us, parts.actuation.send(now_us), armed=self.pilot.state.armed)
        duration_s = self._clock() - started_s
        if guidance is not None:
            self._sample = Sample(now_us, state, guidance, parts.actuation.decision, duration_s)
        return Step(command, decision, duration_s, estimate, parts.stations.failures.take())

    def serve(self, inbox: Iterable[Received]) -> list[Outgoing]:
        """Serve ground stations, and return what to send them; after each `step`, while the plant integrates."""
        now_us = self._time_us
        if now_us is None:
            return self._put_off(inbox)
        if self._sample is not None:
            self._reporter.report(self._sample)
            self._sample = None
        self.stations.receive_status(self._plant_status, now_us)
        self._plant_status = NOTHING
        for datagram, link, address, loopback in inbox:
            self.stations.hub.receive(datagram, link, address, now_us, loopback=loopback)
        self.parts.subscribers.adopt(self.parameters)
        return self.stations.poll(now_us)

    def _put_off(self, inbox: Iterable[Received]) -> list[Outgoing]:
        """Deny commands while nothing is known of the vehicle yet."""
        if self._waiting_us is None:
            return []
        self.stations.refuse_commands("not ready: attitude and position are not known yet")
        for datagram, link, address, loopback in inbox:
            self.stations.hub.receive(datagram, link, address, self._waiting_us, loopback=loopback)
        self.stations.refuse_commands("")
        return self.stations.take_outbox()

    def record(self) -> Checkpoint | None:
        """Return the checkpoint for a restart; None as long as nothing is known of the vehicle."""
        return None if self._time_us is None else self._checkpointer.record(self._time_us)
