"""The plant as a pure composition of physics, sensors and faults, stepped frame by frame."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic
from colibri.common.types import Array
from colibri.mavlink.hil.faults import ALL, BATTERY, MOTOR, OFF, OK, SENSORS, STUCK, WRONG, Fault, judged
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import NOTHING, FaultResult, PlantStatus
from colibri.mavlink.hil.sensors import Frame
from colibri.mavlink.hil.state import ActuatorCommand
from colibri.mavlink.hil.world_changes import PaceChange, PayloadChange, WindChange, WorldChange
from colibri.mavlink.wire.dialect import RESULT_ACCEPTED, RESULT_UNSUPPORTED, Refusal
from colibri.plant.environment.weather import RecordedWind, Wind
from colibri.plant.events import Event, changes_of, check_events, equipment
from colibri.plant.physics.integrators import Integrator
from colibri.plant.physics.start import IntegrationError, Start
from colibri.plant.physics.world import Physics, World, starting_world, state_frame
from colibri.plant.sensors.faults import SensorFaults
from colibri.plant.sensors.suite import SensorSuite
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import Vehicle


class Faults:
    def __init__(self, vehicle: Vehicle, physics: Physics, feedback: Feedback, *, seed: int) -> None:
        self._physics, self._battery = physics, vehicle.battery
        self.sensors = SensorFaults(seed, vehicle.sensors)
        self.parts = equipment(vehicle, on_sensors=feedback is Feedback.SENSORS)
        self._taken_ah = 0.0

    def inject(self, asked: Fault, world: World) -> tuple[World, FaultResult]:
        fault = judged(asked, self.parts, len(world.rotor_speeds))
        if isinstance(fault, Refusal):
            return world, FaultResult(asked.unit, asked.kind, fault.result)
        if fault.unit in SENSORS and fault.unit not in self.sensors.units:
            return world, FaultResult(asked.unit, asked.kind, RESULT_UNSUPPORTED)
        if fault.unit == MOTOR:
            self._on_rotors(fault, world)
        elif fault.unit == BATTERY:
            world = self._on_battery(fault, world)
        else:
            self.sensors.begin(fault, world.time_us)
        return world, FaultResult(fault.unit, fault.kind, RESULT_ACCEPTED)

    def _on_rotors(self, fault: Fault, world: World) -> None:
        chosen = range(len(world.rotor_speeds)) if fault.instance == ALL else (fault.instance - 1,)
        for rotor in chosen:
            held = {OFF: 0.0, STUCK: world.rotor_speeds[rotor]}.get(fault.kind)
            self._physics.hold_rotor(rotor, held)
            self._physics.weaken_rotor(rotor, fault.values[0] if fault.kind == WRONG else 1.0)

    def _on_battery(self, fault: Fault, world: World) -> World:
        assert self._battery is not None, "what there is none of does not fail"
        left, resistance = fault.values[:2] if fault.kind == WRONG else (0.0, 1.0)
        used_ah = world.charge_used_ah - self._taken_ah
        after_ah = used_ah if fault.kind == OK else max(used_ah, (1.0 - left) * self._battery.capacity_ah)
        self._taken_ah = after_ah - used_ah
        self._physics.resist(resistance)
        return world._replace(charge_used_ah=after_ah)


_NEVER_US = 1 << 62


class DelayedCommands:
    """Delayed commands: the rotors follow the last one that has arrived, also between two frames."""

    def __init__(self, first: ActuatorCommand) -> None:
        self.now = first
        self.delay_us: int | None = None
        self._coming: deque[tuple[int, ActuatorCommand]] = deque()

    def arrive(self, from_us: int, command: ActuatorCommand) -> None:
        self._coming.append((from_us, command))

    def spans(self, begin_us: int, end_us: int) -> list[tuple[ActuatorCommand, int]]:
        coming, spans = self._coming, []
        while begin_us < end_us:
            while coming and coming[0][0] <= begin_us:
                from_us, self.now = coming.popleft()
                self.delay_us = from_us - self.now.time_us
            until_us = min(end_us, coming[0][0]) if coming else end_us
            spans.append((self.now, until_us - begin_us))
            begin_us = until_us
        return spans


class Plant:
    """One vehicle in its world; a command acts twice `latency_us` after the frame that it answers."""

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        physics: Physics,
        feedback: Feedback,
        origin: Geodetic,
        *,
        seed: int,
        interval_us: int,
        latency_us: int = 0,
        events: Sequence[Event] = (),
    ) -> None:
        check_events(events, vehicle, on_sensors=feedback is Feedback.SENSORS)
        self._events = deque(changes_of(events))
        self._next_us = self._events[0][0] if self._events else _NEVER_US
        self.world = world
        self.faults = Faults(vehicle, physics, feedback, seed=seed)
        self.interval_us = interval_us
        self._physics = physics
        self._measure: Callable[[World], Frame] = state_frame
        self._suite: SensorSuite | None = None
        if feedback is Feedback.SENSORS:
            assert vehicle.sensors is not None, "only what has sensors serves them"
            faults = self.faults.sensors
            suite = SensorSuite(vehicle.sensors, physics, origin, seed=seed, interval_us=interval_us, faults=faults)
            self._suite = suite
            self._measure = suite.measure
            physics.specific_force(world)  # loads it, before any frame
        self._actuation = DelayedCommands(_held(world, vehicle))
        self._round_trip_us = 2 * latency_us
        self._results: tuple[FaultResult, ...] = ()
        self._may_foresee = latency_us == 0 and physics.is_steady
        self._repeated, self._repeats_after = False, {False: False, True: False}
        self._foreseen: tuple[World, Array] | None = None
        self.flown = physics.rows  # truth after each frame of the last answer, see `physics.frames`

    @property
    def has_news(self) -> bool:
        """Whether a frame without battery may have a status, too."""
        return bool(self._results or self._actuation.delay_us or self._round_trip_us)

    def measure(self, *, with_battery: bool = True) -> tuple[Frame, PlantStatus]:
        battery = self._physics.battery(self.world) if with_battery else None
        delay_us = self._actuation.delay_us or None
        alone = battery is None and not self.has_news
        status = NOTHING if alone else PlantStatus(battery, self._results, delay_us)
        return self._measure(self.world), status

    def answer(self, command: ActuatorCommand, faults: Sequence[Fault | WorldChange] = (), until_us: float = 0) -> None:
        """Fly on with `command` for a frame, or for several up to `until_us`, which need not be measured."""
        self._results = ()
        if faults:
            self.inject(faults)
        before, foreseen, self._foreseen = self._actuation.now, self._foreseen, None
        repeated = command.controls == before.controls and command.armed == before.armed
        self._repeats_after[self._repeated] = self._repeated = repeated
        if foreseen is not None and repeated:
            self._actuation.now, (self.world, self.flown) = command, foreseen
        elif self._round_trip_us:
            self.arrive(self.world.time_us, command)
            self.go_on()
        else:
            self._actuation.now, self._actuation.delay_us = command, 0
            if self.world.time_us >= self._next_us:
                self._happen()
            now_us, frames = self.world.time_us, 1
            if until_us > now_us and not self._results:
                until_event = -(-(self._next_us - now_us) // self.interval_us)
                frames = max(1, min(int(until_us - now_us) // self.interval_us, until_event))
            self.world = self._physics.step(self.world, command, self.interval_us, frames)
            self.flown = self._physics.rows

    def foresee(self) -> None:
        """Integrate the next frame before its command comes, if that is likely to repeat the last one."""
        if self._repeats_after[self._repeated] and self.world.time_us < self._next_us and self._may_foresee:
            with suppress(IntegrationError):
                foreseen = self._physics.step(self.world, self._actuation.now, self.interval_us)
                self._foreseen = foreseen, self._physics.rows

    def inject(self, asked: Sequence[Fault | WorldChange]) -> None:
        """Inject faults and changes of the world now; results of faults go with the next frame."""
        self._foreseen = None
        results = map(self._change, asked)
        self._results = tuple(result for result in results if result is not None)

    def _change(self, asked: Fault | WorldChange | Wind | RecordedWind) -> FaultResult | None:
        if isinstance(asked, WindChange):
            self._physics.blow(Wind(asked.speed_m_s, asked.from_deg))
        elif isinstance(asked, Wind | RecordedWind):
            self._physics.blow(asked)
        elif isinstance(asked, PayloadChange):
            self._physics.carry(asked.mass_kg)
        elif isinstance(asked, PaceChange):
            pass  # of who steps the plant
        else:
            self.world, result = self.faults.inject(asked, self.world)
            return result
        return None

    def _happen(self) -> None:
        events = self._events
        while events and events[0][0] <= self.world.time_us:
            self._change(events.popleft()[1])
        self._next_us = events[0][0] if events else _NEVER_US

    def become(self, vehicle: Vehicle, seed: int) -> None:
        """Go on as a vehicle with the same sensors, and with other noise."""
        self._foreseen = None
        self._physics.become(vehicle)
        if self._suite is not None:
            self._suite.reseed(seed)

    def arrive(self, sent_us: int, command: ActuatorCommand) -> None:
        self._actuation.arrive(sent_us + self._round_trip_us, command)

    def go_on(self) -> None:
        begin_us = self.world.time_us
        if begin_us >= self._next_us:
            self._happen()
        for command, duration_us in self._actuation.spans(begin_us, begin_us + self.interval_us):
            self.world = self._physics.step(self.world, command, duration_us)
        self.flown = self._physics.rows


class PlantBuilder:
    """Builds plants of one vehicle in one world."""

    def __init__(
        self,
        spec: WorldSpec,
        vehicle: Vehicle,
        starts: Mapping[Feedback, Start],
        *,
        integrator: Integrator = "rk4",
        origin: Geodetic = DEFAULT_ORIGIN,
    ) -> None:
        weather = spec.weather
        self.vehicle = vehicle
        self.starts = starts
        self._worlds = {it: starting_world(start, vehicle, weather) for it, start in starts.items()}
        self._physics = Physics(vehicle, integrator, weather, spec.disturbance)
        self._spec = spec
        self._origin = origin

    def build(self, feedback: Feedback, interval_us: int) -> Plant:
        latency_us, world = round(self._spec.latency * 1e3), self._worlds[feedback]
        return Plant(
            world, self.vehicle, self._physics, feedback, self._origin,
            seed=self._spec.seed, interval_us=interval_us, latency_us=latency_us, events=self._spec.events,
        )  # fmt: skip


def _held(world: World, vehicle: Vehicle) -> ActuatorCommand:
    controls = tuple(speed / vehicle.rotors.max_speed for speed in world.rotor_speeds)
    return ActuatorCommand(world.time_us, controls, armed=any(world.rotor_speeds))
