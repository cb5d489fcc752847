"""A flight in lockstep: datagrams pass between plant and autopilot, of this process or others, frame by frame."""

from collections.abc import Sequence
from time import perf_counter, sleep
from typing import NamedTuple, Protocol, TypeAlias

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
from colibri.mavlink.wire.dialect import (
    AUTOPILOT_COMPONENT,
    CMD_SET_MESSAGE_INTERVAL,
    PLANT_COMPONENT,
    RESULT_ACCEPTED,
    TRUTH_COMPONENT,
    Codec,
    mav,
)
from colibri.sitl.backends.link_faults import Pipe, Trouble
from colibri.sitl.errors import SitlError

_QUICK = 10.0
_SOON_S = 2e-4


class StoppedClock:
    """Advances only while the plant waits: both sides are in this process."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def wait(self, timeout_s: float) -> None:
        self._now_s += timeout_s


class QuickClock:
    """Ten times the wall clock, for an autopilot in another process: lost datagrams are repeated sooner."""

    def now_s(self) -> float:
        return _QUICK * perf_counter()

    def wait(self, timeout_s: float) -> None:
        sleep(min(timeout_s / _QUICK, _SOON_S))


LinkClock: TypeAlias = StoppedClock | QuickClock


__tracebackhide__ = True  # a failed test shows its own lines, not these

_HEADER_BYTES, _CRC_BYTES, _COMPONENT_AT = 10, 2, 6
_ANSWER = int(mav.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS).to_bytes(3, "little")
_GLANCE_S = 0.002
_GIVE_UP_S = 200.0
"""In time of the link clock. Flights are independent of it."""


class SessionError(SitlError):
    """A flight cannot go on: a process has died or is silent."""


class PlantSide(Protocol):
    """The plant's side; `process` is its id if it has its own."""

    @property
    def process(self) -> int | None: ...

    @property
    def clock(self) -> LinkClock: ...

    def receive(self, datagram: bytes) -> None: ...

    def frame(self) -> list[bytes]:
        """Return the datagrams up to the next frame, which comes last."""

    def listen(self, timeout_s: float) -> list[bytes]:
        """Return the datagrams sent within `timeout_s`; an unanswered frame is repeated."""

    def close(self) -> None: ...


class AutopilotSide(Protocol):
    """The autopilot's side; `process` is its id if it has its own."""

    @property
    def process(self) -> int | None: ...

    def call(self) -> bytes: ...

    def expect(self, step_message: StepMessage) -> None:
        """Process the datagrams of ground stations for the next frame."""

    def receive(self, datagram: bytes) -> None: ...

    def listen(self) -> list[bytes]: ...

    def answer(self) -> bytes: ...

    def to_stations(self) -> StepMessage: ...

    def kill(self) -> None:
        """End it as a power cut does."""

    def start(self) -> None: ...

    def close(self) -> None: ...


class Instant(NamedTuple):
    """A frame that was flown; `began` is the true state at its start."""

    began: StateFrame
    command: ActuatorCommand
    to_stations: StepMessage
    frame: bytes
    answer: bytes


class LockstepSession:
    """A flight that is stepped; `truth` is the true state now.

    Attributes:
        acks: Answers of the plant to commands: number and MAV_RESULT.
        trouble: Faults of the link between plant and autopilot.

    """

    def __init__(self, plant: PlantSide, autopilot: AutopilotSide, system: int, rotors: int, seed: int = 0) -> None:
        self.plant, self._rotors = plant, rotors
        self.autopilot = autopilot
        self._codec = Codec(system, AUTOPILOT_COMPONENT)
        self._autopilot_source = bytes(self._codec.source)
        self._truth_source = bytes((system, TRUTH_COMPONENT))
        self.acks: list[tuple[int, int]] = []
        self.trouble = Trouble()
        self._up, self._down = (Pipe(self.trouble, f"{seed} plant {way}") for way in ("up", "down"))
        plant.receive(autopilot.call())
        self._frame, self.truth = self._taken_in(plant.frame())
        still = ActuatorCommand(0, (0.0,) * rotors, armed=False)
        self.flown = Instant(self.truth, still, StepMessage(0, ()), b"", b"")

    def advance(self, parcels: Sequence[Parcel], injected: bytes = b"") -> Instant:
        """Fly one frame; frames `injected` are added to the autopilot's answer."""
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
        return self._codec.encode("COMMAND_LONG", self._codec.source[0], PLANT_COMPONENT, number, 0, *values)

    def change_of_world(self, change: WorldChange) -> bytes:
        return encode_change(self._codec, change, (self._codec.source[0], PLANT_COMPONENT))

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
        truth = read_state(true_state, self._truth_source) or self._decoded_state(true_state)
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
            if number == CMD_SET_MESSAGE_INTERVAL and result != RESULT_ACCEPTED:
                raise SessionError("the plant cannot give the requested feedback: fly a vehicle with sensors")
            self.acks.append((number, result))

    def _command(self, answer: bytes) -> ActuatorCommand:
        alone = read_actuators(answer, self._autopilot_source, self._rotors)
        if alone is not None:
            return alone
        for message in self._codec.decode(answer):
            command = decode_actuators(message, self._rotors) if message.name == "HIL_ACTUATOR_CONTROLS" else None
            if command is not None:
                return command
        raise SessionError("the autopilot sent an invalid rotor command")


def answers(datagram: bytes, time_us: int) -> bool:
    """Whether a datagram of unsigned MAVLink 2 frames answers the frame of a time."""
    sought = time_us.to_bytes(8, "little")
    at = 0
    while at < len(datagram):
        if datagram[at + 7 : at + _HEADER_BYTES] == _ANSWER and datagram[at + _HEADER_BYTES : at + 18] == sought:
            return True
        at += _HEADER_BYTES + datagram[at + 1] + _CRC_BYTES
    return False


def parted(datagram: bytes) -> tuple[bytes, bytes]:
    """Split a plant's datagram into the part for the autopilot and the truth behind it."""
    at = 0
    while at < len(datagram) and datagram[at + _COMPONENT_AT] != TRUTH_COMPONENT:
        at += _HEADER_BYTES + datagram[at + 1] + _CRC_BYTES
    return datagram[:at], datagram[at:]


def _us(time_s: float) -> int:
    return round(time_s * 1e6)
