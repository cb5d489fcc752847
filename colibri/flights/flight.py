"""One flight, stepped: a plant, an autopilot, and the wire between them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from colibri.autopilot.core.autopilot import Autopilot, Stages
from colibri.autopilot.core.step import Received, Step, answer
from colibri.common.records import Record
from colibri.common.types import Address, Array
from colibri.flights.snapshots import ObjectSnapshot
from colibri.mavlink.hil.faults import Fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep import BATTERY_EVERY_US, HEARTBEAT_EVERY_US, next_battery_us
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.plant_status import NOTHING
from colibri.mavlink.hil.rounding import state_as_received
from colibri.mavlink.hil.sensors import SensorFrame, sensors_as_received
from colibri.mavlink.hil.state import ROTORS, ActuatorCommand, StateFrame, command_as_received
from colibri.mavlink.hil.world_changes import WorldChange
from colibri.plant.physics.start import Start
from colibri.plant.physics.world import World
from colibri.plant.simulation.plant import Plant, PlantBuilder
from colibri.plant.spec import WorldSpec
from colibri.plant.vehicle.description import Vehicle

if TYPE_CHECKING:
    from colibri.mavlink.node.hub import Outgoing

SYSTEM_ID = 1
NEVER_LATE_S = 0.0
MEMORY_ADDRESS: Address = ("memory", 0)
StagesT = TypeVar("StagesT", bound=Stages)
Traffic: TypeAlias = Callable[[int, list[bytes]], None]
"""Records frames of MAVLink: (simulated time in µs, frames)."""


Answered: TypeAlias = tuple[Step, ActuatorCommand, Sequence[Fault | WorldChange], bytes | None, int]
"""Step, command and faults as they reached the plant; the datagram, empty if only rounded, `None` on `Direct`; and the
time of the next frame that must be exchanged, µs."""


class Wire(Protocol):
    def exchange(self, plant: Plant, autopilot: Autopilot[Any]) -> Answered: ...


class FrameSample(Record, frozen=True):
    """A frame that was flown, or several with the same command; `world` is at the time of the next one."""

    step: Step
    command: ActuatorCommand
    world: World
    datagram: bytes | None
    to_stations: "list[Outgoing]"
    flown: Array  # truth after each frame, see `physics.frames`


class SteppedFlight(Generic[StagesT]):
    """A flight within this process."""

    def __init__(self, plant: Plant, autopilot: Autopilot[StagesT], wire: Wire) -> None:
        self.plant, self.autopilot, self.wire = plant, autopilot, wire

    @property
    def time_us(self) -> int:
        return self.plant.world.time_us

    def step(self, inbox: Iterable[Received] = (), until_us: int = 0) -> FrameSample:
        """Fly a frame, or up to `until_us` those that repeat its command, and serve stations, which sent `inbox`.

        Raises:
            DecisionError, IntegrationError: Autopilot or plant cannot go on.
        """
        plant = self.plant
        step, command, faults, datagram, next_us = self.wire.exchange(plant, self.autopilot)
        plant.answer(command, faults, min(next_us, until_us))
        world, flown = plant.world, plant.flown
        if len(flown) > 1:
            self.autopilot.go_on(world.time_us - plant.interval_us)
        return FrameSample(step, command, world, datagram, self.autopilot.serve(inbox), flown)

    def samples(self, duration_s: float) -> Iterator[FrameSample]:
        """Fly whole frames up to `duration_s` since time 0."""
        end_us = int(duration_s * 1e6)
        while self.plant.world.time_us + self.plant.interval_us <= end_us:
            yield self.step(until_us=end_us)

    def snapshot(self) -> ObjectSnapshot:
        """Keep the state of plant, autopilot and wire; vehicle, profile and track are shared."""
        return ObjectSnapshot((self.plant, self.autopilot, self.wire))

    def restore(self, snapshot: ObjectSnapshot) -> None:
        snapshot.restore()


class Direct:
    """Passes frame and command in double precision, without the codec."""

    def exchange(self, plant: Plant, autopilot: Autopilot[Any]) -> Answered:
        step = autopilot.step(*plant.measure())
        return step, step.command, step.faults, None, 0


def direct_flight(
    autopilot: Autopilot[StagesT], world: WorldSpec, vehicle: Vehicle, feedback: Feedback, start: Start
) -> SteppedFlight[StagesT]:
    """Return a flight of an autopilot without the codec, over the plant of a vehicle."""
    plant = PlantBuilder(world, vehicle, {feedback: start}).build(feedback, autopilot.frame_interval_us)
    return SteppedFlight(plant, autopilot, Direct())


class InMemory:
    """Carries the datagrams of two processes in memory; `traffic` records frames.

    A frame alone is only rounded as its datagram would round it, unless it is recorded, or of sensors and `replayed`.
    """

    def __init__(
        self,
        frame_interval_us: int,
        feedback: Feedback,
        traffic: Traffic | None = None,
        *,
        replayed: bool = True,
        rotors: int = ROTORS,
    ) -> None:
        self._traffic = traffic
        self._encodes = replayed and feedback is Feedback.SENSORS
        self._counted_us = -frame_interval_us  # time of the last frame that both ends have counted
        self.plant_end = PlantEnd(
            system_id=SYSTEM_ID,
            frame_interval_us=frame_interval_us,
            serves=[feedback],
            rotors=rotors,
            takes_ahead=True,
        )
        self.autopilot_end = AutopilotEnd(
            system_id=SYSTEM_ID, frame_interval_us=frame_interval_us, now_s=NEVER_LATE_S, feedback=feedback
        )
        self.autopilot_end.poll(NEVER_LATE_S)
        self._to_plant(0)

    def exchange(self, plant: Plant, autopilot: Autopilot[Any]) -> Answered:
        now_us = plant.world.time_us
        frame, plant_status = plant.measure(with_battery=now_us % BATTERY_EVERY_US == 0)
        received, datagram = None, b""
        if plant_status is NOTHING and self._traffic is None and now_us % HEARTBEAT_EVERY_US:
            received = state_as_received(frame) if isinstance(frame, StateFrame) else sensors_as_received(frame)
        if received is not None:
            step = autopilot.step(received)
            if not step.faults:
                if self._encodes and isinstance(frame, SensorFrame):
                    datagram = self.plant_end.encoded(frame)
                return step, command_as_received(step.command), (), datagram, self._next_us(plant, autopilot, step)
            self.autopilot_end.follow(now_us, self._count_before(now_us, plant.interval_us))
            self.plant_end.offer(frame, NEVER_LATE_S)
            self.plant_end.take_outbox()
            self.autopilot_end.answer(step.command, step.faults)
        else:
            if passed := self._count_before(now_us, plant.interval_us):
                self.autopilot_end.follow(now_us - plant.interval_us, passed)
            self.plant_end.offer(frame, NEVER_LATE_S, plant_status)
            answered, datagram = self._to_autopilot(now_us, autopilot)
            assert answered is not None, "the autopilot answers every new frame"
            step = answered
        awaited = self._to_plant(now_us)
        assert awaited is not None, "the answer names the frame awaited"
        return step, awaited, self.plant_end.take_faults(), datagram, 0

    def _next_us(self, plant: Plant, autopilot: Autopilot[Any], step: Step) -> int:
        """Return the time of the next frame that must be exchanged."""
        now_us = step.command.time_us
        if step.decision is None or plant.has_news:
            return 0
        return min(autopilot.next_us(now_us), next_battery_us(now_us))

    def _count_before(self, now_us: int, interval_us: int) -> int:
        """Have the plant's end count the frames before this one that came without a datagram; return how many."""
        frames, self._counted_us = (now_us - self._counted_us) // interval_us - 1, now_us
        if frames and not self._encodes:
            self.plant_end.skip(frames)
        return frames

    def carried_up(self, datagrams: list[bytes]) -> list[bytes]:
        return datagrams

    def carried_down(self, datagrams: list[bytes]) -> list[bytes]:
        return datagrams

    def _to_autopilot(self, now_us: int, autopilot: Autopilot[Any]) -> tuple[Step | None, bytes]:
        sent = self.plant_end.take_outbox()
        if self._traffic is not None:
            self._traffic(now_us, [frame for outgoing in sent for frame in outgoing.frames])
        step, datagram = None, b""
        for datagram in self.carried_up([outgoing.datagram for outgoing in sent]):
            step = answer(self.autopilot_end, autopilot.step, datagram, NEVER_LATE_S) or step
        return step, datagram

    def _to_plant(self, now_us: int) -> ActuatorCommand | None:
        command = None
        for datagram in self.carried_down(self.autopilot_end.take_outbox()):
            command = self.plant_end.receive(datagram, MEMORY_ADDRESS, NEVER_LATE_S) or command
        if self._traffic is not None:
            self._traffic(now_us, list(self.plant_end.received))
        self.plant_end.received.clear()
        return command
