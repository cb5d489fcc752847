"""A MAVLink component that tests control."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from colibri.mavlink.client.client import HEARTBEAT_EVERY_US, Client
from colibri.mavlink.client.commands import Command, CommandInt
from colibri.mavlink.client.conversation import UNANSWERED, Conversation, Repeat
from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.client.parameters import DIFFERS, ReadParameter, SetParameter
from colibri.mavlink.client.plans import Upload
from colibri.mavlink.mission.items import MISSION, MissionItem
from colibri.mavlink.parameters.store import Value
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Message, mav
from colibri.sitl.backends.link_faults import Pipe, Trouble
from colibri.sitl.errors import SitlError
from colibri.sitl.stepping import NotInTimeError, Stepped

__tracebackhide__ = True  # a failed test shows its own lines, not these

AGAIN_AFTER_S = 0.5  # interval of repeated requests, as in ground stations
ANSWER_WITHIN_S = 15.0
UPLOAD_WITHIN_S = 60.0
_AGAIN_AFTER_US = round(AGAIN_AFTER_S * 1e6)
_REPEAT = Repeat(_AGAIN_AFTER_US, 1 + round(ANSWER_WITHIN_S / AGAIN_AFTER_S))
_UPLOAD_REPEAT = Repeat(_AGAIN_AFTER_US, round(UPLOAD_WITHIN_S / AGAIN_AFTER_S))


class RefusedError(SitlError):
    """The vehicle has refused a request.

    Attributes:
        result: MAV_RESULT, MAV_MISSION_RESULT or MAV_PARAM_ERROR.
        text: The vehicle's STATUSTEXT lines about the refusal.
    """

    def __init__(self, what: str, result: int, text: str) -> None:
        super().__init__(f"{what} was refused: {text or 'no reason given'} (result {result})")
        self.result = result
        self.text = text


class SteppedVehicle(Stepped, Protocol):
    @property
    def system(self) -> int: ...


class Station(Inbox):
    """A MAVLink component with a separate link; received messages are in `Inbox`.

    A method that waits for an answer advances simulated time and repeats its request every half second; it raises
    `RefusedError` if the vehicle refuses, and `NotInTimeError` after `ANSWER_WITHIN_S`.

    Attributes:
        silent: Set it to stop all sending, HEARTBEAT included.
        dropped: Number of invalid frames received, by reason.
    """

    def __init__(
        self,
        flight: SteppedVehicle,
        number: int,
        *,
        system: int,
        component: int,
        trouble: Trouble,
        seed: int,
        beats: bool,
        by_bits: bool = True,
    ) -> None:
        super().__init__()
        self._by_bits = by_bits
        self._flight = flight
        self.number = number
        self.system = system
        self.component = component
        every_us = HEARTBEAT_EVERY_US if beats else None
        self._client = Client(system, component, heartbeat_every_us=every_us, only=flight.system)
        self._up = Pipe(trouble, f"{seed} {number} up")
        self._down = Pipe(trouble, f"{seed} {number} down")
        self.silent = False
        self._kinds: dict[str, int] = {}
        self.dropped = self._client.dropped

    @property
    def _vehicle(self) -> tuple[int, int]:
        return self._flight.system, AUTOPILOT_COMPONENT

    # What a flight does with it.

    def departing(self, now_us: int) -> list[bytes]:
        for datagram in self._client.poll(now_us):
            self.send_raw(datagram)
        return self._up.due(now_us)

    def arriving(self, datagram: bytes, now_us: int) -> None:
        self._down.put(datagram, now_us)

    def listen(self, now_us: int) -> None:
        """Receive the datagrams due."""
        for datagram in self._down.due(now_us):
            for message in self._client.receive(datagram, now_us):
                self.add(message)

    def add(self, message: Message) -> None:
        super().add(message)
        if message.name == "PARAM_VALUE":
            self._kinds[message.fields.param_id] = message.fields.param_type

    # What it sends.

    def send(self, name: str, *fields: Any) -> None:
        """Send a message, with its fields as MAVLink defines them."""
        self.send_raw(self._client.encode(name, *fields))

    def send_raw(self, datagram: bytes) -> None:
        """Send any bytes."""
        if not self.silent:
            self._up.put(datagram, self._flight.time_us)

    def order(self, number: int, *params: float) -> int:
        """Send a COMMAND_LONG and return any MAV_RESULT; missing parameters are 0."""
        return self._acknowledged(Command(self._vehicle, number, *params, repeat=_REPEAT))

    def order_int(
        self, number: int, *params: float, frame: int, x: int = NOT_GIVEN, y: int = NOT_GIVEN, z: float = 0.0
    ) -> int:
        """Send a COMMAND_INT and return any MAV_RESULT."""
        return self._acknowledged(
            CommandInt(self._vehicle, number, *params, frame=frame, x=x, y=y, z=z, repeat=_REPEAT)
        )

    def command(self, number: int, *params: float, what: str = "") -> None:
        """Send a COMMAND_LONG that must be accepted."""
        said = len(self.texts)
        result = self.order(number, *params)
        self.check(result, said, what or f"command {number}")

    def check(self, result: int, said: int, what: str) -> None:
        """Raise unless a result is ACCEPTED; `said` is the number of texts before."""
        if result != mav.MAV_RESULT_ACCEPTED:
            raise RefusedError(what, result, "; ".join(self.texts[said:]))

    def request(self, send: Callable[[int], None], answered: Callable[[], object], what: str) -> None:
        """Send every half second until answered; `send` gets the number of tries before."""
        for tries in range(_REPEAT.tries):
            send(tries)
            again_us = self._flight.time_us + _AGAIN_AFTER_US
            while not answered() and self._flight.time_us < again_us:
                self._flight.step()
            if answered():
                return
        raise self._silence(what)

    # Parameters.

    def get_param(self, name: str) -> Value:
        """Request a parameter."""
        return self._parameter(ReadParameter(self._vehicle, name, by_bits=self._by_bits, repeat=_REPEAT))

    def set_param(self, name: str, value: Value) -> Value:
        """Set a parameter; return its new value."""
        kind, by_bits = self._kinds.get(name), self._by_bits
        change = SetParameter(self._vehicle, name, value, kind=kind, by_bits=by_bits, repeat=_REPEAT)
        taken = self._parameter(change)
        if change.result == DIFFERS:
            raise RefusedError(f"{name} = {value:g}", 0, f"it stays at {taken:g}")
        return taken

    # Plans.

    def upload(self, items: Sequence[MissionItem], plan: int = MISSION, *, what: str = "mission") -> None:
        """Upload a mission, fence or rally points."""
        said = len(self.texts)
        upload = self.begin_upload(items, plan)
        done = lambda: upload.result not in (None, UNANSWERED)  # noqa: E731
        self._flight.wait_until(done, within=UPLOAD_WITHIN_S, what=f"the upload of the {what}")
        if not upload.accepted:
            item = "" if upload.seq is None else f", item {upload.seq}"
            raise RefusedError(what + item, upload.result or 0, "; ".join(self.texts[said:]))

    def begin_upload(self, items: Sequence[MissionItem], plan: int = MISSION) -> Upload:
        """Begin an upload, which continues with the flight."""
        return self._client.begin(Upload(self._vehicle, items, plan, repeat=_UPLOAD_REPEAT))

    def _acknowledged(self, command: Command) -> int:
        self._converse(command, f"the COMMAND_ACK of {command.number}")
        return command.result or 0

    def _parameter(self, conversation: ReadParameter) -> Value:
        name = conversation.name
        self._converse(conversation, f"the PARAM_VALUE of {name}")
        error = conversation.result or 0
        if conversation.held is None or error > 0:
            known = mav.enums["MAV_PARAM_ERROR"].get(error)
            words = known.name.removeprefix("MAV_PARAM_ERROR_").replace("_", " ").lower() if known else "PARAM_ERROR"
            raise RefusedError(f"parameter {name}", error, words)
        return conversation.held.value

    def _converse(self, conversation: Conversation, what: str) -> None:
        self._client.begin(conversation)
        try:
            while conversation.result is None:
                for datagram in self._client.poll_requests(self._flight.time_us):
                    self.send_raw(datagram)
                if conversation.result is None:
                    self._flight.step()
        finally:
            self._client.cancel(conversation)
        if conversation.result == UNANSWERED:
            raise self._silence(what)

    def _silence(self, what: str) -> NotInTimeError:
        return NotInTimeError(
            f"{what}, asked for {_REPEAT.tries} times, took longer than {ANSWER_WITHIN_S:g} s: {self._flight}"
        )
