"""A flight one frame at a time: who conducts it stands between plant and autopilot, and holds simulated time still.

The two may be in this process or in others: see `memory` and `udp`. Either way the same bytes pass.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from mavlink.dialect import (
    AUTOPILOT_COMPONENT,
    CMD_SET_MESSAGE_INTERVAL,
    PLANT_COMPONENT,
    RESULT_ACCEPTED,
    TRUTH_COMPONENT,
    Codec,
)
from mavlink.hil import ActuatorCommand, StateFrame, decode_actuators, decode_state
from mavlink.turns import Parcel, Turn

_HEADER_BYTES, _CRC_BYTES, _COMPONENT_AT = 10, 2, 6


class StageError(Exception):
    """A flight that cannot go on: a process has died, or does not answer; the message says which and why."""


class Plant(Protocol):
    """The plant's side."""

    def hear(self, datagram: bytes) -> None:
        """Take in what an autopilot says that answers no frame: its call."""
        ...

    def frame(self) -> list[bytes]:
        """Return what the plant says up to its next frame, which comes last."""
        ...

    def take(self, answer: bytes) -> None:
        """Take in the answer to that frame, and go on."""
        ...


class Autopilot(Protocol):
    """The autopilot's side."""

    def call(self) -> bytes:
        """Return how it calls a plant."""
        ...

    def tell(self, frame: bytes, turn: Turn) -> None:
        """Tell it a frame of the plant, and what ground stations say then."""
        ...

    def answer(self) -> bytes:
        """Return its answer to the frame."""
        ...

    def said(self) -> Turn:
        """Return what it says to ground stations at that frame."""
        ...

    def kill(self) -> None:
        """End it as a power cut does."""
        ...

    def start(self) -> None:
        """Start it anew."""
        ...

    def close(self) -> None:
        """End it."""
        ...


class Instant(NamedTuple):
    """A frame that was flown.

    Attributes:
        began: How the vehicle was, in truth.
        command: What the autopilot answered.
        said: What it said to ground stations.
        frame: What the plant told the autopilot, as bytes.
        answer: The answer, as bytes.
    """

    began: StateFrame
    command: ActuatorCommand
    said: Turn
    frame: bytes
    answer: bytes


class Stage:
    """Conducts a flight.

    Attributes:
        truth: How the vehicle is now.
        acks: Answers of the plant to commands: number and MAV_RESULT.
    """

    def __init__(self, plant: Plant, autopilot: Autopilot, system: int) -> None:
        """Bring the two together; the vehicle is system `system`."""
        self._plant = plant
        self._autopilot = autopilot
        self._codec = Codec(system, AUTOPILOT_COMPONENT)
        self.acks: list[tuple[int, int]] = []
        plant.hear(autopilot.call())
        self._frame, self.truth = self._next()

    def advance(self, parcels: Sequence[Parcel], injected: bytes = b"") -> Instant:
        """Fly one frame.

        Args:
            parcels: What ground stations say now.
            injected: Frames that go to the plant with the autopilot's answer.

        Raises:
            StageError: The flight cannot go on.
        """
        frame, began = self._frame, self.truth
        self._autopilot.tell(frame, Turn(began.time_us, parcels))
        answer = self._autopilot.answer()
        self._plant.take(answer + injected)
        said = self._autopilot.said()
        self._frame, self.truth = self._next()
        return Instant(began, self._command(answer), said, frame, answer)

    def command_to_plant(self, number: int, *params: float) -> bytes:
        """Return a COMMAND_LONG as the autopilot would send it to the plant."""
        values = (*params, *(0.0,) * (7 - len(params)))
        return self._codec.encode("COMMAND_LONG", self._codec.source[0], PLANT_COMPONENT, number, 0, *values)

    def kill_autopilot(self) -> None:
        """End the autopilot as a power cut does, and start it anew: the plant has waited."""
        self._autopilot.kill()
        self._autopilot.start()
        self._autopilot.call()

    def _next(self) -> tuple[bytes, StateFrame]:
        *others, datagram = self._plant.frame()
        for other in others:
            self._hear(other)
        frame, told = parted(datagram)
        messages = {message.name: message for message in self._codec.decode(told)}
        truth = decode_state(messages["ATTITUDE_QUATERNION"], messages["LOCAL_POSITION_NED"])
        if truth is None:
            raise StageError("the vehicle has left what can be told: its state is not finite")
        return frame, truth

    def _hear(self, datagram: bytes) -> None:
        for message in self._codec.decode(datagram):
            if message.name != "COMMAND_ACK":
                continue
            number, result = message.fields.command, message.fields.result
            if number == CMD_SET_MESSAGE_INTERVAL and result != RESULT_ACCEPTED:
                raise StageError("the plant cannot give the feedback that is asked for: fly a vehicle with sensors")
            self.acks.append((number, result))

    def _command(self, answer: bytes) -> ActuatorCommand:
        for message in self._codec.decode(answer):
            command = decode_actuators(message) if message.name == "HIL_ACTUATOR_CONTROLS" else None
            if command is not None:
                return command
        raise StageError("the autopilot answered with what no rotor can follow")


def frames_of(datagram: bytes) -> Iterator[bytes]:
    """Yield the frames of a datagram of whole MAVLink 2 frames that nobody has signed."""
    at = 0
    while at < len(datagram):
        end = at + _HEADER_BYTES + datagram[at + 1] + _CRC_BYTES
        yield datagram[at:end]
        at = end


def message_id(frame: bytes) -> int:
    """Return the number of the message in a frame of MAVLink 2."""
    return int.from_bytes(frame[7:_HEADER_BYTES], "little")


def parted(datagram: bytes) -> tuple[bytes, bytes]:
    """Return what of a plant's datagram is for the autopilot, and the truth behind it."""
    at = 0
    for frame in frames_of(datagram):
        if frame[_COMPONENT_AT] == TRUTH_COMPONENT:
            break
        at += len(frame)
    return datagram[:at], datagram[at:]
