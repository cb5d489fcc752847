"""The plant's end of the lockstep protocol."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable

from colibri.common.records import Record
from colibri.common.types import Address
from colibri.mavlink.hil import lockstep, plant_status, state
from colibri.mavlink.hil.faults import COMMAND as INJECT_FAILURE
from colibri.mavlink.hil.faults import Fault, decode_fault
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.hil.plant_status import NOTHING, PlantBattery, PlantStatus
from colibri.mavlink.hil.sensors import Frame, SensorFrame, encode_sensors
from colibri.mavlink.hil.state import ROTORS, ActuatorCommand, StateFrame
from colibri.mavlink.hil.world_changes import PACE, PAYLOAD, WIND, WorldChange, decode_change
from colibri.mavlink.wire import dialect
from colibri.mavlink.wire.dialect import Codec, Message

_WITH_THE_ANSWER = frozenset({INJECT_FAILURE, WIND, PAYLOAD, PACE})


class PlantDatagram(Record, frozen=True):
    frames: tuple[bytes, ...]
    address: Address

    @property
    def datagram(self) -> bytes:
        return b"".join(self.frames)


class PlantEnd:
    """The plant's end: offers a frame and waits for its answer."""

    def __init__(
        self,
        *,
        system_id: int,
        frame_interval_us: int,
        serves: Collection[Feedback] = (Feedback.STATE,),
        waits: bool = True,
        takes_ahead: bool = False,
        rotors: int = ROTORS,
        is_there: Callable[[Address], bool] = lambda _: False,
    ) -> None:
        """Begin without autopilot; `is_there` tells whether a silent one still has its address."""
        self.waits = waits  # or runs freely
        self._kind = (lockstep.TAKES_AHEAD if takes_ahead else 0) if waits else lockstep.FREE_RUNNING
        self._rotors = rotors
        self._codec = Codec(system_id, dialect.PLANT_COMPONENT)
        self._truth_codec = Codec(system_id, dialect.TRUTH_COMPONENT)
        self._autopilot = (system_id, dialect.AUTOPILOT_COMPONENT)
        self._autopilot_bytes = bytes(self._autopilot)
        self.peer: Address | None = None
        self.notes: list[str] = []  # for people; the owner clears it
        self._is_there, self._note_at_s = is_there, 0.0
        self.frame_interval_us = frame_interval_us
        self.feedback, self._messages = Feedback.STATE, state.STATE_MESSAGES
        self._serves = frozenset(serves)
        self.resent = 0
        self.dropped: Counter[str] = self._codec.dropped
        self.received: list[bytes] = []  # valid frames; the owner may log and clear it
        self._peer_received_s = 0.0
        self._frames: tuple[bytes, ...] = ()
        self._unanswered: list[tuple[bytes, ...]] = []  # frames sent since the last answer
        self._begun = False
        self._awaited_us: int | None = None
        self._answered_us: int | None = None
        self._accepted: ActuatorCommand | None = None  # the last one
        self._battery: PlantBattery | None = None
        self._faults: list[Fault | WorldChange] = []
        self._resend_at_s = 0.0
        self._outbox: list[PlantDatagram] = []

    def accepts_another(self, now_s: float) -> bool:
        """Whether the peer is lost, so that another autopilot may take over."""
        return not lockstep.is_another(None, self.peer, now_s - self._peer_received_s, self._is_there)

    def sends_battery(self, time_us: int) -> bool:
        return time_us % lockstep.BATTERY_EVERY_US == 0

    def offer(self, frame: Frame, now_s: float, beside: PlantStatus = NOTHING, truth: StateFrame | None = None) -> None:
        """Send `frame`, status and `truth`, as another component's; await the command."""
        if isinstance(frame, StateFrame):
            frames = state.encode_state(self._codec, frame)
        else:
            frames = encode_sensors(self._codec, frame)
        if frame.time_us % lockstep.HEARTBEAT_EVERY_US == 0:
            frames.append(self._heartbeat())
        if beside.results:
            frames += plant_status.encode_results(self._codec, beside.results, self._autopilot)
        if beside.battery is not None:
            self._battery = beside.battery
            if self.sends_battery(frame.time_us):
                frames.append(plant_status.encode_battery(self._codec, beside.battery))
        if beside.delay_us is not None:
            frames.append(plant_status.encode_delay(self._codec, frame.time_us, beside.delay_us))
        if truth is not None:
            frames += state.encode_state(self._truth_codec, truth)
        self._frames = tuple(frames)
        self._begun = True
        self._awaited_us = frame.time_us
        if not self.waits:
            self._unanswered.clear()
        self._unanswered.append(self._frames)
        self._send([self._frames], now_s)

    def receive(self, datagram: bytes, sender: Address, now_s: float) -> ActuatorCommand | None:
        command = state.read_actuators(datagram, self._autopilot_bytes, self._rotors) if sender == self.peer else None
        if command is None:
            return self._receive_any(datagram, sender, now_s)
        self._note(datagram, now_s)
        return self._accept(command)

    def ahead(self, time_us: int) -> ActuatorCommand | None:
        """Return the command of a later frame if the last one answers it, too."""
        last = self._accepted
        if last is None or not last.time_us < time_us < self._answered_until_us(last):
            return None
        return ActuatorCommand(time_us, last.controls, last.armed)

    def next_us(self, time_us: int) -> int:
        """Return the time of the next frame that must be sent."""
        if self._accepted is None or self.feedback is Feedback.SENSORS:
            return 0
        return min(self._answered_until_us(self._accepted), lockstep.next_battery_us(time_us))

    def _answered_until_us(self, command: ActuatorCommand) -> int:
        return command.time_us + command.frames * self.frame_interval_us

    def _receive_any(self, datagram: bytes, sender: Address, now_s: float) -> ActuatorCommand | None:
        command: ActuatorCommand | None = None
        asked: list[Message] = []
        for message in self._codec.decode(datagram):
            if message.source != self._autopilot:
                self.dropped["foreign"] += 1
                continue
            if message.name == "HEARTBEAT":
                self._receive_heartbeat(sender, now_s)
            elif message.name == "COMMAND_LONG" and message.fields.command in _WITH_THE_ANSWER:
                asked.append(message)
            elif message.name == "COMMAND_LONG":
                self._obey(message, sender, now_s)
            elif message.name == "HIL_ACTUATOR_CONTROLS" and sender == self.peer:
                command = self._accept(state.decode_actuators(message, self._rotors)) or command
            else:
                self.dropped["unexpected"] += 1
                continue
            if sender == self.peer:
                self._note(message.frame, now_s)
        for message in asked:
            self._receive_fault(message, answered=command is not None)
        return command

    def skip(self, frames: int = 1) -> None:
        """Count frames that were not encoded, for the numbers of later ones."""
        self._codec.skip(frames * self._messages)

    def encoded(self, frame: SensorFrame) -> bytes:
        return b"".join(encode_sensors(self._codec, frame))

    def take_faults(self) -> list[Fault | WorldChange]:
        """Return the unchecked faults and changes in the last answer."""
        faults, self._faults = self._faults, []
        return faults

    def poll(self, now_s: float) -> float:
        if self._awaited_us is None or not self.waits:
            return now_s + lockstep.RESEND_AFTER_S
        if now_s >= self._resend_at_s:
            self.resent += 1
            self._send(self._unanswered, now_s)
        return self._resend_at_s

    def take_outbox(self) -> list[PlantDatagram]:
        outbox, self._outbox = self._outbox, []
        return outbox

    def _send(self, frames: Iterable[tuple[bytes, ...]], now_s: float) -> None:
        self._resend_at_s = now_s + lockstep.RESEND_AFTER_S
        if self.peer is not None:
            self._outbox += [PlantDatagram(each, self.peer) for each in frames]

    def _receive_heartbeat(self, sender: Address, now_s: float) -> None:
        if sender == self.peer or self._is_another(sender, now_s):
            return
        self.peer = sender
        if self._awaited_us is not None:
            if self._battery is not None:
                self._frames += (plant_status.encode_battery(self._codec, self._battery),)
            if not self.waits:
                self._frames += (self._heartbeat(),)
            self._unanswered[-1:] = [self._frames]
            self._send([self._frames], now_s)

    def _is_another(self, sender: Address, now_s: float) -> bool:
        if not lockstep.is_another(sender, self.peer, now_s - self._peer_received_s, self._is_there):
            return False
        self.dropped["second autopilot"] += 1
        if now_s >= self._note_at_s:
            self._note_at_s = now_s + lockstep.PEER_GIVEN_UP_AFTER_S
            self.notes.append(f"a second autopilot calls from port {sender[1]}: refused, as the first is there")
        return True

    def _heartbeat(self) -> bytes:
        return lockstep.plant_heartbeat(self._codec, self._kind)

    def _receive_fault(self, message: Message, *, answered: bool) -> None:
        fields = message.fields
        if (fields.target_system, fields.target_component) != self._codec.source:
            self.dropped["foreign"] += 1
        elif not answered:
            self.dropped["repeated"] += 1
        elif (asked := (decode_fault if fields.command == INJECT_FAILURE else decode_change)(fields)) is None:
            self.dropped["invalid"] += 1
        else:
            self._faults.append(asked)

    def _obey(self, message: Message, sender: Address, now_s: float) -> None:
        fields = message.fields
        if (fields.target_system, fields.target_component) != self._codec.source:
            self.dropped["foreign"] += 1
            return
        if self._is_another(sender, now_s):
            return
        result: int = dialect.RESULT_UNSUPPORTED
        feedback = lockstep.ASKS_FOR.get(fields.param1) if fields.command == dialect.CMD_SET_MESSAGE_INTERVAL else None
        if feedback in self._serves:
            result = self._set_frames(feedback, fields.param2)
        ack = self._codec.encode("COMMAND_ACK", fields.command, result, 0, 0, *message.source)
        self._outbox.append(PlantDatagram((ack,), sender))

    def _set_frames(self, feedback: Feedback, interval_us: float) -> int:
        if interval_us not in lockstep.FRAME_INTERVALS_US:
            return dialect.RESULT_DENIED
        if self._begun and (feedback, interval_us) != (self.feedback, self.frame_interval_us):
            return dialect.RESULT_TEMPORARILY_REJECTED
        self.feedback, self.frame_interval_us = feedback, int(interval_us)
        self._messages = state.STATE_MESSAGES if feedback is Feedback.STATE else 1
        return dialect.RESULT_ACCEPTED

    def _note(self, frame: bytes, now_s: float) -> None:
        self._peer_received_s = now_s
        self.received.append(frame)

    def _accept(self, command: ActuatorCommand | None) -> ActuatorCommand | None:
        if command is None:
            self.dropped["invalid"] += 1
            return None
        answer = self._awaited(command) if self.waits else self._newest(command)
        if answer is None:
            self.dropped["repeated"] += 1
        elif self.waits:
            self._awaited_us, self._accepted = None, command
            self._unanswered.clear()
        return answer

    def _awaited(self, command: ActuatorCommand) -> ActuatorCommand | None:
        """Return the awaited command; one of several frames may come again."""
        if command.time_us == self._awaited_us:
            return command
        return None if self._awaited_us is None or command != self._accepted else self.ahead(self._awaited_us)

    def _newest(self, command: ActuatorCommand) -> ActuatorCommand | None:
        if self._awaited_us is None or command.time_us > self._awaited_us:
            return None
        if self._answered_us is not None and command.time_us <= self._answered_us:
            return None
        self._answered_us = command.time_us
        return command
