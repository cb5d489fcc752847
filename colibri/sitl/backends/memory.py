"""Plant and autopilot in this process."""

from time import perf_counter

from colibri.autopilot.control.registry import DecisionError
from colibri.autopilot.core.step import answer
from colibri.autopilot.process.ground import GroundService
from colibri.autopilot.spec import AutopilotSpec
from colibri.common.errors import Error
from colibri.common.process.status import Silent
from colibri.flights.flight import MEMORY_ADDRESS, NEVER_LATE_S
from colibri.mavlink.hil.conductor import StepMessage
from colibri.mavlink.hil.lockstep_autopilot import AutopilotEnd
from colibri.mavlink.hil.lockstep_plant import PlantEnd
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.plant.physics.start import IntegrationError
from colibri.plant.physics.world import state_frame
from colibri.plant.process.server import builder_of
from colibri.plant.simulation.plant import Plant
from colibri.plant.spec import PlantSpec
from colibri.sitl.backends.link_faults import LinkClock, SessionError, StoppedClock
from colibri.sitl.backends.setting import SettingError

__tracebackhide__ = True  # a failed test shows its own lines, not these


class MemoryPlant:
    """A plant in this process; `clock` if the autopilot is in another."""

    process = None

    def __init__(self, spec: PlantSpec, clock: LinkClock | None = None) -> None:
        self._builder = builder_of(spec)
        self._answered = False
        self._end = PlantEnd(
            system_id=spec.system_id,
            frame_interval_us=round(1e3 / spec.rate) * 1000,
            serves=tuple(self._builder.starts),
            rotors=self._builder.vehicle.rotors.count,
        )
        self.plant: Plant | None = None
        self.clock: LinkClock = clock or StoppedClock()

    def receive(self, datagram: bytes) -> None:
        command = self._end.receive(datagram, MEMORY_ADDRESS, self.clock.now_s())
        self._end.received.clear()
        if command is None:
            return
        assert self.plant is not None, "it has sent a frame"
        try:
            self.plant.answer(command, self._end.take_faults())
        except IntegrationError as error:
            raise SessionError(str(error)) from error
        self._answered = True

    def frame(self) -> list[bytes]:
        """Return the datagrams up to the next frame, which comes last."""
        self._offer()
        return [outgoing.datagram for outgoing in self._end.take_outbox()]

    def listen(self, timeout_s: float) -> list[bytes]:
        if self._answered:
            self._offer()
        else:
            self.clock.wait(timeout_s)
            self._end.poll(self.clock.now_s())
        return [outgoing.datagram for outgoing in self._end.take_outbox()]

    def close(self) -> None: ...

    def _offer(self) -> None:
        end = self._end
        if self.plant is None:
            self.plant = self._builder.build(end.feedback, end.frame_interval_us)
        self._answered = False
        frame, plant_status = self.plant.measure()
        truth = state_frame(self.plant.world) if isinstance(frame, SensorFrame) else None
        end.offer(frame, self.clock.now_s(), plant_status, truth)


class MemoryAutopilot:
    """An autopilot in this process; a new one after a restart."""

    process = None

    def __init__(self, spec: AutopilotSpec) -> None:
        self._spec = spec
        self.start()

    def start(self) -> None:
        spec = self._spec
        try:
            self._conductor = _MemoryConductor()
            self._ground = GroundService(spec, *spec.load(), Silent(), self._conductor)
        except Error as error:
            raise SettingError(str(error)) from error
        self.autopilot = self._ground.autopilot
        self.connect()

    def connect(self) -> None:
        """Reset the connection, so that the next frame may have any time."""
        spec = self._spec
        self._end = AutopilotEnd(
            system_id=spec.system_id,
            frame_interval_us=self.autopilot.frame_interval_us,
            now_s=NEVER_LATE_S,
            feedback=spec.feedback,
        )

    def call(self) -> bytes:
        self._end.poll(NEVER_LATE_S)
        (call,) = self._end.take_outbox()
        return call

    def expect(self, step_message: StepMessage) -> None:
        self._conductor.from_stations = step_message

    def receive(self, datagram: bytes) -> None:
        try:
            answer(self._end, self.autopilot.step, datagram, NEVER_LATE_S)
        except DecisionError as error:
            raise SessionError(f"the autopilot ended: {error}") from error

    def listen(self) -> list[bytes]:
        return self._end.take_outbox()

    def answer(self) -> bytes:
        if self._ground.shut_down:
            raise SessionError("the autopilot ended with exit code 0")
        (answer,) = self._end.take_outbox()
        return answer

    def to_stations(self) -> StepMessage:
        self.autopilot = self._ground.serve(perf_counter())
        assert self._conductor.to_stations is not None, "it has served them"
        return self._conductor.to_stations

    def kill(self) -> None:
        self._ground.abandon()

    def close(self) -> None:
        self._ground.close()


class _MemoryConductor:
    from_stations: StepMessage | None = None
    to_stations: StepMessage | None = None

    def receive(self) -> StepMessage | None:
        return self.from_stations

    def send(self, step_message: StepMessage) -> None:
        self.to_stations = step_message

    def close(self) -> None: ...
