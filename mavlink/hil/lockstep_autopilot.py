"""The autopilot's end of the lockstep protocol."""

from collections.abc import Callable, Sequence

from colibri.mavlink.hil import lockstep
from colibri.mavlink.hil.faults import COMMAND as INJECT_FAILURE
from colibri.mavlink.hil.faults import Fault, encode_fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.lockstep import CALL_AFTER_S, FREE_RUNNING, TAKES_AHEAD, AnsweringEnd
from colibri.mavlink.hil.plant_status import PlantStatus, ReceivedFrame, decode_battery, decode_delay, decode_result
from colibri.mavlink.hil.sensors import Frame, decode_sensors, read_sensors
from colibri.mavlink.hil.state import ActuatorCommand, decode_state, encode_actuators, read_state
from colibri.mavlink.hil.world_changes import WorldChange, encode_change
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Message

_NO_TIMES = range(0)
_READERS = {Feedback.STATE: read_state, Feedback.SENSORS: read_sensors}


class AutopilotEnd(AnsweringEnd):
    """The autopilot's end: calls the plant, returns each new frame once."""

    def __init__(
        self, *, system_id: int, frame_interval_us: int, now_s: float, feedback: Feedback = Feedback.STATE
    ) -> None:
        super().__init__(system_id, now_s - CALL_AFTER_S, now_s)
        self._plant = (system_id, dialect.PLANT_COMPONENT)
        self._plant_bytes = bytes(self._plant)
        self._frame_interval_us = frame_interval_us
        self._feedback = feedback
        self._made_of = lockstep.MADE_OF[feedback]
        self._read: Callable[[bytes, bytes], Frame | None] = _READERS[feedback]
        self._kind: int | None = None  # of the plant
        self._is_plain = False  # whether the last frame came alone
        self._answered_us = _NO_TIMES  # times of the frames of the last answer that need no other one

    def receive(self, datagram: bytes, now_s: float) -> ReceivedFrame | None:
        """Return the datagram's frame if it is the next one to compute."""
        frame = self._read(datagram, self._plant_bytes)
        self._is_plain = frame is not None
        if frame is None:
            return self._receive_any(datagram, now_s)
        following = self._next(frame, now_s)
        return None if following is None else ReceivedFrame(following)

    def _receive_any(self, datagram: bytes, now_s: float) -> ReceivedFrame | None:
        parts: dict[str, Message] = {}
        battery, delay_us, results = None, None, []
        for message in self._codec.decode(datagram):
            if message.source != self._plant:
                self.dropped["foreign"] += 1
            elif message.name in self._made_of:
                parts[message.name] = message
            elif message.name == "COMMAND_ACK" and message.fields.command == INJECT_FAILURE:
                results.append(decode_result(message))
            elif message.name == "COMMAND_ACK":
                number, result = message.fields.command, message.fields.result
                refused = number == dialect.CMD_SET_MESSAGE_INTERVAL and result != dialect.RESULT_ACCEPTED
                self.refused = result if refused else None
            elif message.name == "BATTERY_STATUS":
                battery = decode_battery(message)
            elif message.name == "NAMED_VALUE_INT":
                delay_us = decode_delay(message)
            elif message.name == "HEARTBEAT":
                if self._kind is None or self.silence_s(now_s) >= CALL_AFTER_S:
                    self._kind = message.fields.custom_mode
            else:
                self.dropped["unexpected"] += 1
        if not parts:
            return None
        frame = self._decoded(parts)
        if frame is None:
            self.dropped["invalid"] += 1
            return None
        following = self._next(frame, now_s)
        return None if following is None else ReceivedFrame(following, PlantStatus(battery, tuple(results), delay_us))

    def follow(self, time_us: int, answers: int) -> None:
        """Go on from a frame that came without a datagram, after so many answers without one."""
        self._time_us = time_us
        self._codec.skip(answers)

    def answer(self, command: ActuatorCommand, faults: Sequence[Fault | WorldChange] = ()) -> None:
        """Answer the last frame, or several frames from it on: of these, frames of states are not returned."""
        if command.time_us in self._answered_us:
            return
        answer = encode_actuators(self._codec, command)
        for fault in faults:
            encode = encode_fault if isinstance(fault, Fault) else encode_change
            answer += encode(self._codec, fault, self._plant)  # type: ignore[arg-type]
        if command.time_us % lockstep.HEARTBEAT_EVERY_US == 0:
            answer += self._heartbeat(command.armed)
        interval_us = self._frame_interval_us
        answered_us = range(command.time_us, command.time_us + command.frames * interval_us, interval_us)
        if command.frames > 1 and self._feedback is Feedback.STATE:
            self._time_us, self._answered_us = answered_us[-1], answered_us
        else:
            self._answered_us = answered_us[1:]
        self._answer = answer
        self._outbox.append(answer)

    def may_answer_ahead(self, time_us: int) -> bool:
        """Whether the plant takes an answer to the frame of a coming time; one of states must hold nothing else."""
        if self._kind != TAKES_AHEAD or time_us % lockstep.HEARTBEAT_EVERY_US == 0:
            return False
        return self._feedback is Feedback.SENSORS or (self._is_plain and time_us % lockstep.BATTERY_EVERY_US != 0)

    def poll(self, now_s: float) -> float:
        if self.silence_s(now_s) < CALL_AFTER_S:
            return self._received_s + CALL_AFTER_S
        if now_s >= self._call_at_s:
            self._call_at_s = now_s + lockstep.CALL_EVERY_S
            self._outbox.append(self._call())
        return self._call_at_s

    def _decoded(self, parts: dict[str, Message]) -> Frame | None:
        first, *others = (parts.get(name) for name in self._made_of)
        if first is None:
            return None
        came = [message for message in others if message is not None]
        if self._feedback is Feedback.SENSORS:
            return decode_sensors(first, *came)
        return decode_state(first, *came) if came else None

    def _next(self, frame: Frame, now_s: float) -> Frame | None:
        knows_all = self._feedback is Feedback.STATE and frame.time_us in self._answered_us
        if frame.time_us == self._time_us or knows_all:
            self._received_s = now_s
            self._answer_again()
            return None
        if self._time_us is not None and not self._follows(frame.time_us, self._time_us):
            lost = self.silence_s(now_s) >= CALL_AFTER_S
            if not lost or not (self._kind == FREE_RUNNING or frame.time_us == 0):
                self.dropped["out of step"] += 1
                return None
        self._received_s = now_s
        self._time_us = frame.time_us
        if frame.time_us not in self._answered_us:
            self._answer, self._answered_us = None, _NO_TIMES
        return frame

    def _follows(self, time_us: int, before_us: int) -> bool:
        return time_us > before_us if self._kind == FREE_RUNNING else time_us == before_us + self._frame_interval_us

    def _call(self) -> bytes:
        asked = (lockstep.ASKED_BY[self._feedback], self._frame_interval_us, *(0.0,) * 5)
        request = self._codec.encode("COMMAND_LONG", *self._plant, dialect.CMD_SET_MESSAGE_INTERVAL, 0, *asked)
        return request + self._heartbeat(armed=False)
