"""A flight in lockstep: plant and autopilot exchange datagrams, frame by frame."""

from collections.abc import Sequence
from typing import TypeAlias

from colibri.autopilot.core.autopilot import Autopilot
from colibri.autopilot.core.copter import Copter
from colibri.mavlink.hil.conductor import Parcel, StepMessage
from colibri.mavlink.hil.state import (
    ActuatorCommand,
    StateFrame,
    decode_actuators,
    decode_state,
    read_actuators,
    read_state,
)
from colibri.mavlink.hil.world_changes import WorldChange, encode_change
from colibri.mavlink.wire import dialect
from colibri.plant.physics.world import World
from colibri.plant.simulation.plant import Plant
from colibri.sitl.backends.link_faults import Instant, Pipe, SessionError, Trouble, answers, parted, source_of
from colibri.sitl.backends.memory import MemoryAutopilot, MemoryPlant
from colibri.sitl.backends.udp import UdpAutopilot, UdpPlant
from colibri.sitl.errors import SitlError

__tracebackhide__ = True  # a failed test shows its own lines, not these

PlantSide: TypeAlias = MemoryPlant | UdpPlant
AutopilotSide: TypeAlias = MemoryAutopilot | UdpAutopilot
_GLANCE_S = 0.002
_GIVE_UP_S = 200.0  # in time of the link clock. Flights are independent of it.


class LockstepSession:
    """A flight that is stepped; `truth` is the true state now, `acks` are the plant's answers: number, MAV_RESULT."""

    def __init__(self, plant: PlantSide, autopilot: AutopilotSide, system: int, rotors: int, seed: int = 0) -> None:
        self.plant, self._rotors = plant, rotors
        self.autopilot = autopilot
        self._codec = dialect.Codec(system, dialect.AUTOPILOT_COMPONENT)
        self._autopilot_source = bytes(self._codec.source)
        self.acks: list[tuple[int, int]] = []
        self.trouble = Trouble()
        self._up, self._down = (Pipe(self.trouble, f"{seed} plant {way}") for way in ("up", "down"))
        plant.receive(autopilot.call())
        self._frame, self.truth = self._taken_in(plant.frame())
        still = ActuatorCommand(0, (0.0,) * rotors, armed=False)
        self.flown = Instant(self.truth, still, StepMessage(0, ()), b"", b"")

    def advance(self, parcels: Sequence[Parcel], injected: bytes = b"") -> Instant:
        """Fly one frame; `injected` frames join the autopilot's answer."""
        frame, began = self._frame, self.truth
        step_message = StepMessage(began.time_us, parcels)
        self.autopilot.expect(step_message)
        if self.trouble.any:
            answer, to_stations, received = self._struggle(frame, began.time_us, injected)
        else:
            self.autopilot.receive(frame)
            # What comes last is waited for first: to be woken for each datagram would cost a turn of the core each.
            to_stations = self.autopilot.to_stations()
            answer = self.autopilot.answer()
            self.plant.receive(answer + injected)
            received = self.plant.frame()
        self._frame, self.truth = self._taken_in(received)
        if injected:
            self._read_acks(self._frame)
        self.flown = Instant(began, self._command(answer), to_stations, frame, answer)
        return self.flown

    def _struggle(self, frame: bytes, time_us: int, injected: bytes) -> tuple[bytes, StepMessage, list[bytes]]:
        """Pass a frame over a faulty link; return answer, messages to stations, datagrams of the plant."""
        plant, autopilot, up, down = self.plant, self.autopilot, self._up, self._down
        now_s = plant.clock.now_s
        began_s = now_s()
        up.put(frame, _us(began_s))
        answer, to_stations, received = b"", None, list[bytes]()
        while True:
            now_us = _us(now_s())
            for datagram in up.due(now_us):
                autopilot.receive(datagram)
            for datagram in autopilot.listen():
                if not answer and answers(datagram, time_us):
                    answer, to_stations = datagram, autopilot.to_stations()
                down.put(datagram + injected, now_us)
            for datagram in down.due(now_us):
                plant.receive(datagram)
            for datagram in plant.listen(_GLANCE_S):
                is_frame = bool(parted(datagram)[1])
                if is_frame and parted(datagram)[0] == frame:
                    up.put(frame, now_us)
                    continue
                received.append(datagram)
                if is_frame and to_stations is not None:
                    return answer, to_stations, received
            if now_s() > began_s + _GIVE_UP_S:
                raise SessionError("no message passes between plant and autopilot, despite repeats")

    def measure_again(self) -> None:
        self._frame, self.truth = self._taken_in(self.plant.frame())

    def command_to_plant(self, number: int, *params: float) -> bytes:
        values = (*params, *(0.0,) * (7 - len(params)))
        return self._codec.encode("COMMAND_LONG", self._codec.source[0], dialect.PLANT_COMPONENT, number, 0, *values)

    def change_of_world(self, change: WorldChange) -> bytes:
        return encode_change(self._codec, change, (self._codec.source[0], dialect.PLANT_COMPONENT))

    def processes(self) -> dict[str, int]:
        sides = {"plant": self.plant.process, "autopilot": self.autopilot.process}
        return {name: number for name, number in sides.items() if number is not None}

    def kill_autopilot(self) -> None:
        self.autopilot.kill()
        self.autopilot.start()
        self.autopilot.call()

    def _taken_in(self, datagrams: list[bytes]) -> tuple[bytes, StateFrame]:
        *others, datagram = datagrams
        for other in others:
            self._read_acks(other)
        frame, true_state = parted(datagram)
        truth = read_state(true_state, source_of(true_state)) or self._decoded_state(true_state)
        if truth is None:
            raise SessionError("the state of the vehicle is not finite")
        return frame, truth

    def _decoded_state(self, true_state: bytes) -> StateFrame | None:
        messages = {message.name: message for message in self._codec.decode(true_state)}
        return decode_state(messages["ATTITUDE_QUATERNION"], messages["LOCAL_POSITION_NED"])

    def _read_acks(self, datagram: bytes) -> None:
        for message in self._codec.decode(datagram):
            if message.name != "COMMAND_ACK":
                continue
            number, result = message.fields.command, message.fields.result
            if number == dialect.CMD_SET_MESSAGE_INTERVAL and result != dialect.RESULT_ACCEPTED:
                raise SessionError("the plant cannot give the requested feedback: fly a vehicle with sensors")
            self.acks.append((number, result))

    def _command(self, answer: bytes) -> ActuatorCommand:
        command = read_actuators(answer, self._autopilot_source, self._rotors)
        if command is not None:
            return command
        for message in self._codec.decode(answer):
            command = decode_actuators(message, self._rotors) if message.name == "HIL_ACTUATOR_CONTROLS" else None
            if command is not None:
                return command
        raise SessionError("the autopilot sent an invalid rotor command")


class Inside:
    """Plant and autopilot, for tests of internal state; only in memory."""

    def __init__(self, session: LockstepSession) -> None:
        plant, autopilot = session.plant, session.autopilot
        if not (isinstance(plant, MemoryPlant) and isinstance(autopilot, MemoryAutopilot)):
            raise SitlError("nothing can be seen inside another process: fly with --sitl-link memory")
        assert plant.plant is not None, "it has sent a frame"
        self._session = session
        self._side = autopilot
        self.plant: Plant = plant.plant

    @property
    def autopilot(self) -> Autopilot[Copter]:
        """The autopilot; a new one after a restart."""
        return self._side.autopilot

    @property
    def copter(self) -> Copter:
        return self._side.autopilot.stages

    @property
    def world(self) -> World:
        return self.plant.world

    @world.setter
    def world(self, world: World) -> None:
        self.plant.world = world
        self._measure_again()

    def skip(self, frames: int) -> None:
        """Run the plant alone for some frames, with the last command."""
        for _ in range(frames):
            self.plant.go_on()
        self._measure_again()

    def _measure_again(self) -> None:
        self._side.connect()
        self._session.measure_again()


def _us(time_s: float) -> int:
    return round(time_s * 1e6)
