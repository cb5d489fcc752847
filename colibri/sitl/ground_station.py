"""A ground station, or whatever else speaks MAVLink to the vehicle: what it sends and what it has received."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from colibri.mavlink.mission.items import MISSION, MissionItem
from colibri.mavlink.parameters.store import Kind, Value, bits_of, value_of
from colibri.mavlink.services.command import NOT_GIVEN
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Bits, Codec, Message, mav, param_bits
from colibri.sitl.backends.link_faults import Pipe, Trouble
from colibri.sitl.errors import SitlError
from colibri.sitl.inbox import Inbox
from colibri.sitl.stepping import Stepped

HEARTBEAT_EVERY_US = 1_000_000
AGAIN_AFTER_S = 0.5
"""What stays unanswered is requested again, as ground stations do."""
ANSWER_WITHIN_S = 15.0
_IN_PROGRESS: int = mav.MAV_RESULT_IN_PROGRESS


class RefusedError(SitlError):
    """The vehicle has refused a request.

    Attributes:
        result: MAV_RESULT, MAV_MISSION_RESULT or MAV_PARAM_ERROR.
        text: Its STATUSTEXT lines about it.
    """

    def __init__(self, what: str, result: int, text: str) -> None:
        """Name what was refused, with which number and text."""
        super().__init__(f"{what} was refused: {text or 'without a word'} (result {result})")
        self.result = result
        self.text = text


class SteppedVehicle(Stepped, Protocol):
    """A vehicle in a flight that can go on."""

    @property
    def system(self) -> int:
        """The vehicle's system id."""


class Station(Inbox):
    """A component on a link of its own; what it has received is in `Inbox`.

    What it sends goes out with the next frame; what waits for an answer lets simulated time go on, and repeats the
    request every half second until the answer comes; a `RefusedError` is raised where the vehicle refuses, a
    `NotInTimeError` where it does not answer within `ANSWER_WITHIN_S`. Its methods are the vocabulary of tests.

    Attributes:
        system, component: Its ids.
        number: Of its link.
        silent: Whether it sends nothing, no HEARTBEAT either, while it still receives.
        dropped: What came and was no message, by reason.
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
    ) -> None:
        """Be component `component` of `system` on link `number`; one that `beats` sends a HEARTBEAT a second."""
        super().__init__()
        self._flight = flight
        self.number = number
        self.system = system
        self.component = component
        self._codec = Codec(system, component)
        self._up = Pipe(trouble, f"{seed} {number} up")
        self._down = Pipe(trouble, f"{seed} {number} down")
        self._beats = beats
        self._beat_at_us = 0
        self.silent = False
        self._uploads: list[Upload] = []
        self._kinds: dict[str, Kind] = {}
        self._values: dict[str, Value] = {}
        self._param_errors: dict[str, int] = {}
        self.dropped = self._codec.dropped

    # What a flight does with it.

    def departing(self, now_us: int) -> list[bytes]:
        """Return the datagrams that reach the vehicle now."""
        if self._beats and now_us >= self._beat_at_us:
            self._beat_at_us = now_us + HEARTBEAT_EVERY_US
            kind, nobody = mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID
            self.send("HEARTBEAT", kind, nobody, 0, 0, mav.MAV_STATE_ACTIVE, 3)
        if self._uploads:
            for upload in self._uploads:
                upload.poll(now_us)
            self._uploads = [upload for upload in self._uploads if upload.result is None]
        return self._up.due(now_us)

    def arriving(self, datagram: bytes, now_us: int) -> None:
        """Take in a datagram that the vehicle sends now: it arrives when the link lets it."""
        self._down.put(datagram, now_us)

    def listen(self, now_us: int) -> None:
        """Receive what has arrived."""
        for datagram in self._down.due(now_us):
            for message in self._codec.decode(datagram):
                if message.source == (self._flight.system, AUTOPILOT_COMPONENT):
                    self.add(message)

    def add(self, message: Message) -> None:
        """Add a message of the vehicle, and note which request it answers."""
        super().add(message)
        name, fields = message.name, message.fields
        if name == "PARAM_VALUE":
            kind = Kind(fields.param_type)
            self._kinds[fields.param_id] = kind
            self._values[fields.param_id] = value_of(kind, param_bits(message))
        elif name == "PARAM_ERROR":
            self._param_errors[fields.param_id] = fields.error
        elif name in ("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"):
            for upload in self._uploads:
                upload.receive(name, fields)

    # What it sends.

    def send(self, name: str, *fields: Any) -> None:
        """Send a message, with its fields as MAVLink defines them."""
        self.send_raw(self._codec.encode(name, *fields))

    def send_raw(self, datagram: bytes) -> None:
        """Send any bytes."""
        if not self.silent:
            self._up.put(datagram, self._flight.time_us)

    def order(self, number: int, *params: float) -> int:
        """Send a COMMAND_LONG and return the MAV_RESULT, whatever it is; parameters that are left out are 0."""
        values = (*params, *(0.0,) * (7 - len(params)))
        vehicle = (self._flight.system, AUTOPILOT_COMPONENT)
        return self._acknowledged(
            number, lambda tries: self.send("COMMAND_LONG", *vehicle, number, min(tries, 255), *values)
        )

    def order_int(
        self, number: int, *params: float, frame: int, x: int = NOT_GIVEN, y: int = NOT_GIVEN, z: float = 0.0
    ) -> int:
        """Send a COMMAND_INT and return the MAV_RESULT, whatever it is."""
        values = (*params, *(0.0,) * (4 - len(params)))
        head = (self._flight.system, AUTOPILOT_COMPONENT, frame, number, 0, 0)
        return self._acknowledged(number, lambda _: self.send("COMMAND_INT", *head, *values, x, y, z))

    def command(self, number: int, *params: float, what: str = "") -> None:
        """Send a COMMAND_LONG."""
        said = len(self.texts)
        result = self.order(number, *params)
        self.check(result, said, what or f"command {number}")

    def check(self, result: int, said: int, what: str) -> None:
        """See that a result is ACCEPTED; `said` is how many texts had been received before."""
        if result != mav.MAV_RESULT_ACCEPTED:
            raise RefusedError(what, result, "; ".join(self.texts[said:]))

    def request(self, send: Callable[[int], None], answered: Callable[[], object], what: str) -> None:
        """Send a request, and repeat it every half second until it is answered; `send` gets how many came before."""
        flight = self._flight
        gives_up_us = flight.time_us + round(ANSWER_WITHIN_S * 1e6)
        tries = 0
        while not answered():
            send(tries)
            tries += 1
            again_us = flight.time_us + round(AGAIN_AFTER_S * 1e6)
            if again_us > gives_up_us:
                flight.wait_until(answered, within=AGAIN_AFTER_S, what=f"{what}, asked for {tries} times,")
                return
            flight.wait_until(
                lambda due_us=again_us: answered() or flight.time_us >= due_us,  # type: ignore[misc]
                within=2.0 * AGAIN_AFTER_S,
                what=what,
            )

    # Parameters.

    def get_param(self, name: str) -> Value:
        """Request a parameter."""
        self._values.pop(name, None)
        vehicle = (self._flight.system, AUTOPILOT_COMPONENT)
        return self._parameter(name, lambda: self.send("PARAM_REQUEST_READ", *vehicle, name, -1))

    def set_param(self, name: str, value: Value) -> Value:
        """Set a parameter; return the value that it has then."""
        if name not in self._kinds:
            self.get_param(name)
        kind = self._kinds[name]
        bits = Bits(bits_of(kind, round(value) if kind is Kind.INT else float(value)))
        vehicle = (self._flight.system, AUTOPILOT_COMPONENT)
        self._values.pop(name, None)
        taken = self._parameter(name, lambda: self.send("PARAM_SET", *vehicle, name, bits, kind))
        if bits_of(kind, taken) != bits.pattern:
            raise RefusedError(f"{name} = {value:g}", 0, f"it stays at {taken:g}")
        return taken

    # Plans.

    def upload(self, items: Sequence[MissionItem], plan: int = MISSION, *, what: str = "mission") -> None:
        """Upload a mission, fence or rally points."""
        said = len(self.texts)
        upload = self.begin_upload(items, plan)
        self._flight.wait_until(lambda: upload.result is not None, within=60.0, what=f"the upload of the {what}")
        if upload.result != mav.MAV_MISSION_ACCEPTED:
            raise RefusedError(what, upload.result or 0, "; ".join(self.texts[said:]))

    def begin_upload(self, items: Sequence[MissionItem], plan: int = MISSION) -> "Upload":
        """Begin an upload, which goes on by itself while the flight does."""
        upload = Upload(self, (self._flight.system, AUTOPILOT_COMPONENT), items, plan)
        self._uploads.append(upload)
        return upload

    def _acknowledged(self, number: int, send: Callable[[int], None]) -> int:
        before = len(self.acks)

        def results() -> list[int]:
            to_us = (0, self.system)
            mine = (ack for ack in self.acks[before:] if ack.command == number and ack.target_system in to_us)
            return [int(ack.result) for ack in mine if ack.result != _IN_PROGRESS]

        self.request(send, results, f"the COMMAND_ACK of {number}")
        return results()[0]

    def _parameter(self, name: str, send: Callable[[], None]) -> Value:
        self._param_errors.pop(name, None)
        self.request(
            lambda _: send(), lambda: name in self._values or name in self._param_errors, f"the PARAM_VALUE of {name}"
        )
        if name in self._param_errors:
            error = self._param_errors[name]
            known = mav.enums["MAV_PARAM_ERROR"].get(error)
            words = known.name.removeprefix("MAV_PARAM_ERROR_").replace("_", " ").lower() if known else "PARAM_ERROR"
            raise RefusedError(f"parameter {name}", error, words)
        return self._values[name]


class Upload:
    """An upload on its way, https://mavlink.io/en/services/mission.html: the vehicle requests item after item.

    Attributes:
        result: MAV_MISSION_RESULT; None before the end.
    """

    def __init__(self, station: Station, vehicle: tuple[int, int], items: Sequence[MissionItem], plan: int) -> None:
        """Begin."""
        self.result: int | None = None
        self._station = station
        self._vehicle = vehicle
        self._items = tuple(items)
        self._plan = plan
        self._again_at_us = 0
        self._last: tuple[str, tuple[Any, ...]] = ("MISSION_COUNT", (*vehicle, len(self._items), plan))

    def poll(self, now_us: int) -> None:
        """Repeat the last message while nothing comes back."""
        if now_us >= self._again_at_us:
            self._again_at_us = now_us + round(AGAIN_AFTER_S * 1e6)
            name, fields = self._last
            self._station.send(name, *fields)

    def receive(self, name: str, fields: Any) -> None:
        """Take in a request or the acknowledgement of the vehicle."""
        if fields.target_system not in (0, self._station.system) or fields.mission_type != self._plan:
            return
        if name == "MISSION_ACK":
            self.result = fields.type
        elif fields.seq < len(self._items):
            item = self._items[fields.seq]
            head = (*self._vehicle, fields.seq, item.frame, item.command, 0)
            self._last = ("MISSION_ITEM_INT", (*head, *item[2:], self._plan))
            self._again_at_us = 0
