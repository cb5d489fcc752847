"""The vehicle at the other end of a link: bytes and the own time in, bytes and timed states out."""

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from colibri.companion.conversation.commands import CommandQueue
from colibri.companion.conversation.parameters import ParameterReader
from colibri.companion.stacks.recognition import recognised
from colibri.companion.stacks.stack import Stack
from colibri.mavlink.client.clock import VehicleClock
from colibri.mavlink.client.report import VehicleReport
from colibri.mavlink.client.states import HANDLES, StateAssembler, TimedState
from colibri.mavlink.wire.dialect import (
    AUTOPILOT_COMPONENT,
    AUTOPILOT_INVALID,
    CMD_SET_MESSAGE_INTERVAL,
    STATE_ACTIVE,
    Codec,
    Message,
    definition_of,
    mav,
)
from colibri.mavlink.wire.signing import Signing

OWN_SYSTEM, OWN_COMPONENT = 1, mav.MAV_COMP_ID_ONBOARD_COMPUTER
_HEARTBEAT_EVERY_US = 500_000
_RENEW_EVERY_US = 3_000_000
_ENOUGH_OF_A_STREAM = 0.5
_SECOND_US = 1_000_000
_VERSION_TRIES = 4
_VERSION_EVERY_US = 400_000
_REMEMBERED_DELAYS = 50


class ReceivedState(NamedTuple):
    """A state, and when it was, by the own clock."""

    at_us: int
    state: TimedState


class VehiclePeer:
    """One vehicle.

    Attributes:
        report: What it says of itself.
        clock: Its clock.
        orders: Commands that move it: modes, arming.
        stack: Its flight stack; None until it is known.
        system: Its system id; 0 until it is known.
        parameters: Read of it; None until its stack is known.
    """

    def __init__(self, stack: Stack | None = None) -> None:
        """Wait for a vehicle; its `stack` is recognised where none is given."""
        self.codec = Codec(OWN_SYSTEM, OWN_COMPONENT)
        self.report = VehicleReport()
        self.clock = VehicleClock()
        self.orders = CommandQueue()
        self.stack = stack
        self.system = 0
        self.parameters: ParameterReader | None = None
        self._signing: Signing | None = None
        self._now_us = 0
        self._states = StateAssembler()
        self._questions = CommandQueue()
        self._heartbeat_at_us: int | None = None
        self._renew_at_us = 0
        self._version_at_us = 0
        self._version_tries = 0
        self._arrivals_us: deque[int] = deque()
        self._delays_us: deque[int] = deque(maxlen=_REMEMBERED_DELAYS)

    @property
    def connected(self) -> bool:
        """Whether vehicle and stack are known."""
        return self.system != 0 and self.stack is not None

    @property
    def parameter_values(self) -> dict[str, float] | None:
        """Return the parameters; None until all are read."""
        return self.parameters.values if self.parameters is not None and self.parameters.done else None

    def state_rate_hz(self, now_us: int) -> float:
        """Return how many states came in the last second."""
        return float(sum(1 for at_us in self._arrivals_us if now_us - at_us <= _SECOND_US))

    @property
    def state_delay_s(self) -> float:
        """How old states are when they come: the median, s."""
        delays = sorted(self._delays_us)
        return 1e-6 * delays[len(delays) // 2] if delays else 0.0

    def sign_with(self, signing: Signing | None) -> None:
        """Sign what is sent, and drop what is not signed with the same key; None: neither."""
        self._signing = signing
        self.codec.seal = None if signing is None else lambda frame: signing.sign(frame, 0, self._now_us)

    def receive(self, datagram: bytes, now_us: int) -> list[ReceivedState]:
        """Take in what came; return the states in it."""
        received = []
        self._now_us = now_us
        for message in self.codec.decode(datagram):
            if self._signing is not None and self._signing.refusal(message.name, message.frame, now_us) is not None:
                continue
            if message.source[1] != AUTOPILOT_COMPONENT or not self._is_vehicle(message):
                continue
            state = self._take(message, now_us)
            if state is not None:
                received.append(state)
        return received

    def poll(self, now_us: int) -> list[bytes]:
        """Return what is due: heartbeats, requests, commands."""
        self._now_us = now_us
        frames = []
        if self._heartbeat_at_us is None or now_us >= self._heartbeat_at_us:
            self._heartbeat_at_us = now_us + _HEARTBEAT_EVERY_US
            kind = mav.MAV_TYPE_ONBOARD_CONTROLLER
            frames.append(self.codec.encode("HEARTBEAT", kind, AUTOPILOT_INVALID, 0, 0, STATE_ACTIVE, 3))
        if self.system == 0:
            return frames
        self._recognise(now_us)
        asked = self.clock.request(now_us)
        if asked is not None:
            frames.append(self.codec.encode("TIMESYNC", *asked))
        self._renew_streams(now_us)
        for queue in (self.orders, self._questions):
            for number, confirmation, params in queue.poll(now_us):
                frames.append(self._command(number, confirmation, params))
        if self.parameters is not None:
            for name in self.parameters.poll(now_us):
                frames.append(self.codec.encode("PARAM_REQUEST_READ", *self.target, name, -1))
        return frames

    @property
    def target(self) -> tuple[int, int]:
        """System and component that commands are for."""
        return (self.system, AUTOPILOT_COMPONENT)

    def _command(self, number: int, confirmation: int, params: tuple[float, ...]) -> bytes:
        return self.codec.encode("COMMAND_LONG", *self.target, number, confirmation, *params)

    def _is_vehicle(self, message: Message) -> bool:
        if self.system:
            return message.source[0] == self.system
        if message.name == "HEARTBEAT" and message.fields.autopilot != AUTOPILOT_INVALID:
            self.system = message.source[0]
        return bool(self.system)

    def _take(self, message: Message, now_us: int) -> ReceivedState | None:
        self.report.receive(message, now_us)
        fields = message.fields
        match message.name:
            case "TIMESYNC":
                self.clock.receive(fields.tc1, fields.ts1, now_us)
            case "COMMAND_ACK":
                self.orders.receive(fields.command, fields.result)
                self._questions.receive(fields.command, fields.result)
            case "AUTOPILOT_VERSION" if self.stack is None:
                self._meet(recognised(self.report.autopilot, bytes(fields.uid2)))
            case "PARAM_VALUE" | "PARAM_ERROR" if self.parameters is not None:
                self.parameters.receive(message)
            case name if name in HANDLES:
                return self._timed(message, now_us)
        return None

    def _timed(self, message: Message, now_us: int) -> ReceivedState | None:
        state = self._states.receive(message, now_us)
        if state is None:
            return None
        self._arrivals_us.append(now_us)
        while self._arrivals_us[0] < now_us - _SECOND_US:
            self._arrivals_us.popleft()
        if not self.clock.known:
            return None
        at_us = min(self.clock.own_us(state.vehicle_us), now_us)
        self._delays_us.append(now_us - at_us)
        return ReceivedState(at_us, state)

    def _recognise(self, now_us: int) -> None:
        """Ask a vehicle that may be of several stacks which it is; by its HEARTBEAT alone if it does not say."""
        if self.stack is not None:
            if self.parameters is None:
                self._meet(self.stack)
            return
        if now_us < self._version_at_us:
            return
        self._version_at_us = now_us + _VERSION_EVERY_US
        self._version_tries += 1
        if self._version_tries > _VERSION_TRIES:
            self._meet(recognised(self.report.autopilot, b""))
        else:
            self._questions.ask("version", mav.MAV_CMD_REQUEST_MESSAGE, float(mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION))

    def _meet(self, stack: Stack | None) -> None:
        if stack is None:
            return
        self.stack = stack
        self.parameters = ParameterReader(stack.parameters, integers_by_bits=stack.integers_by_bits)

    def _renew_streams(self, now_us: int) -> None:
        """Ask for the streams, and again while states come at less than half of the rate that was asked for."""
        if self.stack is None or now_us < self._renew_at_us or not self._questions.idle:
            return
        self._renew_at_us = now_us + _RENEW_EVERY_US
        wanted_hz = max(self.stack.streams[name] for name in HANDLES & self.stack.streams.keys())
        if self.state_rate_hz(now_us) >= _ENOUGH_OF_A_STREAM * wanted_hz:
            return
        for name, interval_us in _intervals(self.stack):
            number = float(definition_of(name).id)
            self._questions.ask(f"stream {name}", CMD_SET_MESSAGE_INTERVAL, number, interval_us)


def _intervals(stack: Stack) -> Iterator[tuple[str, float]]:
    for name, rate_hz in stack.streams.items():
        yield name, 1e6 / rate_hz
