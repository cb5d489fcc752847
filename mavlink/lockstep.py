"""The lockstep conversation between plant and autopilot, its two ends as state machines without input or output.

Datagrams and the wall-clock time go in, datagrams come out. The plant sends the frame of time t and advances only
with the command that names t, so nothing that a link does to datagrams can change a flight:

- a frame unanswered for `RESEND_AFTER_S` is sent again;
- a repeated frame gets the remembered answer, so each frame is computed once;
- what names another time than the one awaited is dropped.

The autopilot calls the plant with one datagram: SET_MESSAGE_INTERVAL (which message it wants, and how often:
ATTITUDE_QUATERNION for frames of the state, HIL_SENSOR for frames of sensors) and a HEARTBEAT. The plant begins with
the first such call, and answers an autopilot that was started again where the flight stands.

Beside its frame the plant tells of its battery twice a second, and to whoever has just called. The autopilot may append
faults, COMMAND_LONG with MAV_CMD_INJECT_FAILURE, to the datagram that answers a frame: they are taken with that answer
and with no other datagram, so each happens once, at that time; the next frame brings their COMMAND_ACK.

A plant that runs freely waits for nobody: it says so in its HEARTBEAT, sends each frame once, and takes any answer that
is newer than the last. The autopilot then goes on from whatever newer frame it gets.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from typing import NamedTuple, TypeAlias

from mavlink import dialect
from mavlink.aside import NOTHING, Aside, PlantBattery, decode_battery, decode_result, encode_battery, encode_results
from mavlink.dialect import Codec, Message
from mavlink.failures import COMMAND as INJECT_FAILURE
from mavlink.failures import Fault, decode_fault, encode_fault
from mavlink.feedback import Feedback
from mavlink.hil import ActuatorCommand, StateFrame, decode_actuators, decode_state, encode_actuators, encode_state
from mavlink.sensors import Frame, decode_sensors, encode_sensors

Address: TypeAlias = tuple[str, int]

RESEND_AFTER_S = 0.02
"""Wall-clock silence after which the plant sends its frame again."""
PEER_LOST_AFTER_S = 0.5
"""Wall-clock silence after which another autopilot may take over the plant."""
CALL_AFTER_S = 1.0
"""Wall-clock silence after which the autopilot calls the plant again, and would begin a new flight."""
CALL_EVERY_S = 0.05
HEARTBEAT_EVERY_US = 1_000_000
BATTERY_EVERY_US = 500_000
FREE_RUNNING = 1
"""HEARTBEAT.custom_mode of a plant that does not wait for answers."""
MIN_FRAME_INTERVAL_US = 1_000
MAX_FRAME_INTERVAL_US = 1_000_000

_ASKED_BY = {Feedback.STATE: dialect.MSG_ATTITUDE_QUATERNION, Feedback.SENSORS: dialect.MSG_HIL_SENSOR}
"""The message whose interval an autopilot sets."""
_ASKS_FOR = {message_id: feedback for feedback, message_id in _ASKED_BY.items()}
_MADE_OF = {
    Feedback.STATE: ("ATTITUDE_QUATERNION", "LOCAL_POSITION_NED"),
    Feedback.SENSORS: ("HIL_SENSOR", "HIL_GPS"),
}


class Outgoing(NamedTuple):
    """A datagram to send, the address it goes to, and the frames that it is made of."""

    frames: tuple[bytes, ...]
    address: Address

    @property
    def datagram(self) -> bytes:
        """The bytes to send."""
        return b"".join(self.frames)


class PlantEnd:
    """The plant's end: offers a frame, waits for its answer.

    Attributes:
        peer: Where the autopilot is, None until one has called.
        frame_interval_us: Time between frames; fixed once the first frame was offered.
        feedback: Which frames the autopilot wants; fixed then, too.
        resent: How many times a frame was sent again.
        dropped: What was received and not used, by reason.
        received: Frames of the autopilot that were understood, in order; the owner may log and clear it.
        waits: Whether a frame is sent again until it is answered; else the plant runs freely.
    """

    def __init__(
        self,
        *,
        system_id: int,
        frame_interval_us: int,
        serves: Collection[Feedback] = (Feedback.STATE,),
        waits: bool = True,
    ) -> None:
        """Wait for the autopilot of `system_id`; `frame_interval_us` holds unless it asks for another.

        It may ask for what the plant `serves`; the state, unless it does.
        """
        self.waits = waits
        self._codec = Codec(system_id, dialect.PLANT_COMPONENT)
        self._truth_codec = Codec(system_id, dialect.TRUTH_COMPONENT)
        self._autopilot = (system_id, dialect.AUTOPILOT_COMPONENT)
        self.peer: Address | None = None
        self.frame_interval_us = frame_interval_us
        self.feedback = Feedback.STATE
        self._serves = frozenset(serves)
        self.resent = 0
        self.dropped: Counter[str] = self._codec.dropped
        self.received: list[bytes] = []
        self._peer_heard_s = 0.0
        self._frames: tuple[bytes, ...] = ()
        self._begun = False
        self._awaited_us: int | None = None
        self._answered_us: int | None = None
        self._battery: PlantBattery | None = None
        self._faults: list[Fault] = []
        self._resend_at_s = 0.0
        self._outbox: list[Outgoing] = []

    def offer(self, frame: Frame, now_s: float, aside: Aside = NOTHING, truth: StateFrame | None = None) -> None:
        """Send `frame`, of the kind of `feedback`, and what goes beside it; await the command that answers it.

        The `truth` is appended, as another component's, for whoever stands in between: it is not the autopilot's.
        """
        if isinstance(frame, StateFrame):
            frames = encode_state(self._codec, frame)
        else:
            frames = encode_sensors(self._codec, frame)
        if frame.time_us % HEARTBEAT_EVERY_US == 0:
            frames.append(self._heartbeat())
        if aside.results:
            frames += encode_results(self._codec, aside.results, self._autopilot)
        self._battery = aside.battery
        if aside.battery is not None and frame.time_us % BATTERY_EVERY_US == 0:
            frames.append(encode_battery(self._codec, aside.battery))
        if truth is not None:
            frames += encode_state(self._truth_codec, truth)
        self._frames = tuple(frames)
        self._begun = True
        self._awaited_us = frame.time_us
        self._send_frame(now_s)

    def receive(self, datagram: bytes, sender: Address, now_s: float) -> ActuatorCommand | None:
        """Take one datagram in; return the command that answers the frame awaited, if it holds that."""
        command = None
        asked: list[Message] = []
        for message in self._codec.decode(datagram):
            if message.source != self._autopilot:
                self.dropped["foreign"] += 1
                continue
            if message.name == "HEARTBEAT":
                self._hear_heartbeat(sender, now_s)
            elif message.name == "COMMAND_LONG" and message.fields.command == INJECT_FAILURE:
                asked.append(message)
            elif message.name == "COMMAND_LONG":
                self._obey(message, sender)
            elif message.name == "HIL_ACTUATOR_CONTROLS" and sender == self.peer:
                command = self._accept(message) or command
            else:
                self.dropped["unexpected"] += 1
                continue
            if sender == self.peer:
                self._peer_heard_s = now_s
                self.received.append(message.frame)
        for message in asked:
            self._hear_fault(message, answered=command is not None)
        return command

    def take_faults(self) -> list[Fault]:
        """Return the faults that came with the last answer, and forget them; nobody has judged them yet."""
        faults, self._faults = self._faults, []
        return faults

    def poll(self, now_s: float) -> float:
        """Do what is due at `now_s`; return the time at which something will be due again."""
        if self._awaited_us is None or not self.waits:
            return now_s + RESEND_AFTER_S
        if now_s >= self._resend_at_s:
            self.resent += 1
            self._send_frame(now_s)
        return self._resend_at_s

    def take_outbox(self) -> list[Outgoing]:
        """Return the datagrams to send now, and forget them."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def _send_frame(self, now_s: float) -> None:
        self._resend_at_s = now_s + RESEND_AFTER_S
        if self.peer is not None:
            self._outbox.append(Outgoing(self._frames, self.peer))

    def _hear_heartbeat(self, sender: Address, now_s: float) -> None:
        if sender == self.peer:
            return
        if self.peer is not None and now_s - self._peer_heard_s < PEER_LOST_AFTER_S:
            self.dropped["second autopilot"] += 1
            return
        self.peer = sender
        if self._awaited_us is not None:
            if self._battery is not None:
                self._frames += (encode_battery(self._codec, self._battery),)
            if not self.waits:
                self._frames += (self._heartbeat(),)
            self._send_frame(now_s)

    def _heartbeat(self) -> bytes:
        mode = 0 if self.waits else FREE_RUNNING
        return _heartbeat(self._codec, dialect.TYPE_GENERIC, dialect.AUTOPILOT_INVALID, armed=False, custom_mode=mode)

    def _hear_fault(self, message: Message, *, answered: bool) -> None:
        fields = message.fields
        if (fields.target_system, fields.target_component) != self._codec.source:
            self.dropped["foreign"] += 1
        elif not answered:
            self.dropped["repeated"] += 1
        elif (fault := decode_fault(fields)) is None:
            self.dropped["invalid"] += 1
        else:
            self._faults.append(fault)

    def _obey(self, message: Message, sender: Address) -> None:
        fields = message.fields
        if (fields.target_system, fields.target_component) != self._codec.source:
            self.dropped["foreign"] += 1
            return
        result: int = dialect.RESULT_UNSUPPORTED
        feedback = _ASKS_FOR.get(fields.param1) if fields.command == dialect.CMD_SET_MESSAGE_INTERVAL else None
        if feedback in self._serves:
            result = self._set_frames(feedback, fields.param2)
        ack = self._codec.encode("COMMAND_ACK", fields.command, result, 0, 0, *message.source)
        self._outbox.append(Outgoing((ack,), sender))

    def _set_frames(self, feedback: Feedback, interval_us: float) -> int:
        whole_ms = MIN_FRAME_INTERVAL_US <= interval_us <= MAX_FRAME_INTERVAL_US and interval_us % 1000 == 0
        if not whole_ms:
            return dialect.RESULT_DENIED
        if self._begun and (feedback, interval_us) != (self.feedback, self.frame_interval_us):
            return dialect.RESULT_TEMPORARILY_REJECTED
        self.feedback, self.frame_interval_us = feedback, int(interval_us)
        return dialect.RESULT_ACCEPTED

    def _accept(self, message: Message) -> ActuatorCommand | None:
        command = decode_actuators(message)
        if command is None:
            self.dropped["invalid"] += 1
        elif not self._is_awaited(command.time_us):
            self.dropped["repeated"] += 1
            command = None
        elif self.waits:
            self._awaited_us = None
        else:
            self._answered_us = command.time_us
        return command

    def _is_awaited(self, time_us: int) -> bool:
        if self.waits or self._awaited_us is None:
            return time_us == self._awaited_us
        return time_us <= self._awaited_us and (self._answered_us is None or time_us > self._answered_us)


class AutopilotEnd:
    """The autopilot's end: calls the plant, hands each new frame out once, remembers the last answer.

    Attributes:
        refused: The plant's refusal of the frames asked for (a MAV_RESULT), None if there was none.
        repeated: How many frames came again and got the remembered answer.
        dropped: What was received and not used, by reason.
        aside: What the plant told beside the frame that was handed out last.
    """

    def __init__(
        self, *, system_id: int, frame_interval_us: int, now_s: float, feedback: Feedback = Feedback.STATE
    ) -> None:
        """Speak as the autopilot of `system_id`, ask the plant for a frame of `feedback` every `frame_interval_us`."""
        self._codec = Codec(system_id, dialect.AUTOPILOT_COMPONENT)
        self._plant = (system_id, dialect.PLANT_COMPONENT)
        self._frame_interval_us = frame_interval_us
        self._feedback = feedback
        self._made_of = _MADE_OF[feedback]
        self.aside = NOTHING
        self._runs_freely = False
        self.refused: int | None = None
        self.repeated = 0
        self.dropped: Counter[str] = self._codec.dropped
        self._time_us: int | None = None
        self._answer: bytes | None = None
        self._heard_s = now_s - CALL_AFTER_S
        self._call_at_s = now_s
        self._outbox: list[bytes] = []

    def silence_s(self, now_s: float) -> float:
        """How long the plant has been silent."""
        return now_s - self._heard_s

    def receive(self, datagram: bytes, now_s: float) -> Frame | None:
        """Take one datagram in; return its frame if that is the next one to compute."""
        parts: dict[str, Message] = {}
        battery, results = None, []
        for message in self._codec.decode(datagram):
            if message.source != self._plant:
                self.dropped["foreign"] += 1
            elif message.name in self._made_of:
                parts[message.name] = message
            elif message.name == "COMMAND_ACK" and message.fields.command == INJECT_FAILURE:
                results.append(decode_result(message))
            elif message.name == "COMMAND_ACK":
                self._hear_ack(message)
            elif message.name == "BATTERY_STATUS":
                battery = decode_battery(message)
            elif message.name == "HEARTBEAT":
                self._runs_freely = message.fields.custom_mode == FREE_RUNNING
            else:
                self.dropped["unexpected"] += 1
        if not parts:
            return None
        frame = self._decoded(parts)
        if frame is None:
            self.dropped["invalid"] += 1
            return None
        following = self._next(frame, now_s)
        if following is not None:
            self.aside = Aside(battery, tuple(results))
        return following

    def answer(self, command: ActuatorCommand, faults: Sequence[Fault] = ()) -> None:
        """Send the command that answers the frame handed out last, with faults to happen then, and remember it."""
        answer = encode_actuators(self._codec, command)
        for fault in faults:
            answer += encode_fault(self._codec, fault, self._plant)
        if command.time_us % HEARTBEAT_EVERY_US == 0:
            answer += self._heartbeat(command.armed)
        self._answer = answer
        self._outbox.append(answer)

    def poll(self, now_s: float) -> float:
        """Do what is due at `now_s`; return the time at which something will be due again."""
        if self.silence_s(now_s) < CALL_AFTER_S:
            return self._heard_s + CALL_AFTER_S
        if now_s >= self._call_at_s:
            self._call_at_s = now_s + CALL_EVERY_S
            self._outbox.append(self._call())
        return self._call_at_s

    def take_outbox(self) -> list[bytes]:
        """Return the datagrams to send to the plant now, and forget them."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def _decoded(self, parts: dict[str, Message]) -> Frame | None:
        first, second = (parts.get(name) for name in self._made_of)
        if first is None:
            return None
        if self._feedback is Feedback.SENSORS:
            return decode_sensors(first, second)
        return None if second is None else decode_state(first, second)

    def _next(self, frame: Frame, now_s: float) -> Frame | None:
        lost = self.silence_s(now_s) >= CALL_AFTER_S
        if frame.time_us == self._time_us:
            self._heard_s = now_s
            self.repeated += 1
            if self._answer is not None:
                self._outbox.append(self._answer)
            return None
        if self._time_us is not None and not lost and not self._follows(frame.time_us, self._time_us):
            self.dropped["out of step"] += 1
            return None
        self._heard_s = now_s
        self._time_us = frame.time_us
        self._answer = None
        return frame

    def _follows(self, time_us: int, before_us: int) -> bool:
        return time_us > before_us if self._runs_freely else time_us == before_us + self._frame_interval_us

    def _hear_ack(self, message: Message) -> None:
        fields = message.fields
        refused = fields.command == dialect.CMD_SET_MESSAGE_INTERVAL and fields.result != dialect.RESULT_ACCEPTED
        self.refused = fields.result if refused else None

    def _call(self) -> bytes:
        request = self._codec.encode(
            "COMMAND_LONG",
            *self._plant,
            dialect.CMD_SET_MESSAGE_INTERVAL,
            0,
            _ASKED_BY[self._feedback],
            self._frame_interval_us,
            *[0.0] * 5,
        )
        return request + self._heartbeat(armed=False)

    def _heartbeat(self, armed: bool) -> bytes:
        return _heartbeat(self._codec, dialect.TYPE_QUADROTOR, dialect.AUTOPILOT_GENERIC, armed)


def _heartbeat(codec: Codec, kind: int, autopilot: int, armed: bool, custom_mode: int = 0) -> bytes:
    mode = dialect.MODE_ARMED if armed else 0
    return codec.encode("HEARTBEAT", kind, autopilot, mode, custom_mode, dialect.STATE_ACTIVE, 3)
