"""The stages of a vehicle with ground stations; after an exception it flies on (see `core.defence`)."""

from collections.abc import Iterable, Iterator

from colibri.autopilot.control.interface import Clock, Decision, VehicleState
from colibri.autopilot.control.profile import Profile
from colibri.autopilot.core.autopilot import Autopilot, ControlSample
from colibri.autopilot.core.checkpoint import Checkpoint, Checkpointer, History, fingerprint_of
from colibri.autopilot.core.defence import table
from colibri.autopilot.core.defence.inertial_estimate import StateEstimates
from colibri.autopilot.core.flight_start import FlightStart
from colibri.autopilot.core.flying import Flying
from colibri.autopilot.core.parts import Parts, parts_of
from colibri.autopilot.core.report import Reporter
from colibri.autopilot.core.step import Received
from colibri.autopilot.core.supervision import Supervision
from colibri.autopilot.estimation.state_source import NewEstimator, estimator_for
from colibri.autopilot.ground.stations import StationSettings
from colibri.autopilot.guidance.trajectories.tracks import Track
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.plant_status import NOTHING, PlantBattery, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.hil.world_changes import WorldChange
from colibri.mavlink.node.hub import Outgoing
from colibri.mavlink.parameters.store import Value
from colibri.plant.vehicle.description import Vehicle

_SETTLES_WITHIN_US = 100_000  # parameters are settled this often even if messages use up the budget


def copter_autopilot(
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
) -> "Autopilot[Copter]":
    """Return an autopilot that flies `vehicle` by `profile` as ground stations command.

    Args:
        clock: Seconds; it only measures.
        values: Of parameters that were changed before.
        first: A track flown from time 0 on, in the air; without it the vehicle stands, or is picked up in hold.
        estimator: By default the one for the settings' feedback.
        history: Of a flight in which an autopilot was killed; it goes on if the first frame is of the same flight.
        strict: Whether exceptions in flight are raised.

    Raises:
        AutopilotError: The profile cannot be used, or the parameters make an impossible vehicle.
        VehicleError: The feedback is of sensors that the vehicle has not.
    """
    estimator = estimator or estimator_for(settings.feedback, vehicle, settings.origin)
    parts = parts_of(profile, vehicle, settings, clock, values, first, estimator, strict)
    checkpointer = Checkpointer(fingerprint_of(profile, vehicle), parts)
    start_speed = profile.simulation.rotor_speed(vehicle)
    return Autopilot(Copter(parts, checkpointer, history, start_speed, vehicle.gravity_m_s2), clock)


class Copter:
    """Flies a vehicle by its pilot, under supervision, and serves ground stations."""

    repeats = False

    def __init__(
        self, parts: Parts, checkpointer: Checkpointer, history: History | None, start_speed: float, gravity_m_s2: float
    ) -> None:
        self.parts = parts
        self.loop, self.delay, self.state_source = parts.loop, parts.delay, parts.state_source
        self.pilot, self.parameters, self.stations = parts.pilot, parts.parameters, parts.stations
        self.defence, self.guard = parts.defence, parts.defence.guard
        self._checkpointer = checkpointer
        self.defence.keep(lambda: None if self.time_us is None else checkpointer.record(self.time_us))
        self._estimates = StateEstimates(parts.state_source, self.defence, gravity_m_s2)
        self._supervision = Supervision(parts)
        self._flying = flying = Flying(parts)
        self.estimate, self.guide, self.decide = self._estimates.state, flying.guide, flying.decide
        self.rescue = flying.rescue
        self._start = FlightStart(parts, self._supervision, checkpointer, history, start_speed)
        self._reporter = Reporter(parts)
        self._sampled: tuple[ControlSample, Decision | None, float] | None = None
        self._plant_status = NOTHING
        self.time_us: int | None = None  # of the last frame with a known state
        self.waiting_us: int | None = None
        self._settles_by_us = 0

    @property
    def mode(self) -> str:
        return str(self.pilot.state.mode)

    @property
    def samples(self) -> int:
        return self._reporter.samples

    @property
    def resumed(self) -> str:
        return self._start.resumed

    def receive(self, frame: Frame, plant_status: PlantStatus) -> None:
        self._plant_status, self.defence.frame = plant_status, frame
        battery = plant_status.battery
        if battery is not None:
            self.guard(table.BATTERY, self._know_charge, table.nothing, battery)
        if plant_status.delay_us is not None:
            self.delay.measure(plant_status.delay_us)
        if self._start.wakes:
            self.guard(table.RESTART, self._start.wake, table.nothing, frame.time_us)

    def _know_charge(self, battery: PlantBattery) -> None:
        if battery.exists:
            self.loop.know_charge(battery.used_ah)
        self.parts.battery.receive(battery)

    def wait(self, now_us: int) -> None:
        """Deny commands before the first estimate; after a flight, prepare the next one."""
        self.waiting_us = now_us
        if self.time_us is not None:
            self.stations.system.reboot()

    def enter(self, known: StateFrame, now_us: int, *, begins: bool) -> None:
        if begins and not any(self.guard(part, self._begin, bool, known) for part in (table.RESTART, table.START)):
            self._flying.descend(now_us)
        self.time_us = now_us

    def _begin(self, known: StateFrame) -> bool:
        self._start.begin(known, self.time_us)
        self.delay.begin(self.parts.actuation.sent)
        return True

    def ahead(self, known: StateFrame) -> StateFrame:
        return self.delay.ahead(known, self.parts.battery.charge_ah, standing=self.pilot.ground.standing)

    def supervise(self, now_us: int, state: VehicleState) -> None:
        if self._estimates.blind:
            self._flying.go_blind()
        self._supervision.step(now_us, state)

    def actuate(self, now_us: int) -> ActuatorCommand:
        return ActuatorCommand(now_us, self.parts.actuation.send(now_us), armed=self._flying.armed)

    def faults(self) -> tuple[Fault | WorldChange, ...]:
        return self.guard(table.FAULTS, self.stations.failures.take, tuple)

    def sampled(self, sample: ControlSample, duration_s: float) -> None:
        self._sampled = sample, self.parts.actuation.decision, duration_s

    def serve(self, inbox: Iterable[Received]) -> list[Outgoing]:
        now_us = self.time_us
        if now_us is None:
            return self._refuse(inbox)
        self._report()
        plant_status, self._plant_status = self._plant_status, NOTHING
        self.guard(table.STATIONS, self.stations.receive_status, table.nothing, plant_status, now_us)
        self._receive_from_stations(inbox, now_us)
        if self.parameters.proposed and (self.parts.budget.allows(now_us) or now_us >= self._settles_by_us):
            self._settles_by_us = now_us + _SETTLES_WITHIN_US
            self.guard(table.PARAMETERS, self.parameters.settle, table.nothing)
        subscribers = self.parts.subscribers
        if self.parameters.revision != subscribers.revision:
            self.guard(table.PARAMETERS, subscribers.adopt, lambda: subscribers.keep(self.parameters), self.parameters)
        return self.stations.poll(now_us)

    def record(self) -> Checkpoint | None:
        now_us = self.time_us
        if now_us is None:
            return None
        return self.guard(table.CHECKPOINT, lambda: self._checkpointer.record(now_us), lambda: None)

    def _report(self) -> None:
        sampled, self._sampled = self._sampled, None
        if sampled is not None:
            self.guard(table.TELEMETRY, self._reporter.report, self.stations.go_on, *sampled)

    def _receive_from_stations(self, inbox: Iterable[Received], now_us: int) -> None:
        if self.stations.hub.waiting:
            self.guard(table.DATAGRAM, self.stations.hub.work, table.nothing, now_us)
        if not inbox:
            return
        arriving = iter(inbox)
        while self.guard(table.DATAGRAM, self._receive_one, lambda: True, arriving, now_us):
            pass

    def _receive_one(self, arriving: Iterator[Received], now_us: int) -> bool:
        received = next(arriving, None)
        if received is None:
            return False
        datagram, link, address, owner = received
        self.stations.hub.receive(datagram, link, address, now_us, owner=owner)
        return True

    def _refuse(self, inbox: Iterable[Received]) -> list[Outgoing]:
        if self.waiting_us is None:
            return []
        self.stations.refuse_commands("Not ready: no attitude and position estimate yet")
        self._receive_from_stations(inbox, self.waiting_us)
        self.stations.refuse_commands("")
        return self.stations.hub.take_outbox()
