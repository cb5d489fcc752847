"""Streams: messages at each channel's rates, and on request."""

from collections.abc import Callable, Iterable, Mapping
from typing import TypeAlias

from colibri.mavlink.node.service import Fields, Peer, Send, to
from colibri.mavlink.services.command import TEMPORARILY_REJECTED, UNSUPPORTED, Handler, ReceivedCommand
from colibri.mavlink.streaming.rates import GCS, PX4_STREAMS, SILENT, Streams
from colibri.mavlink.streaming.schedule import Schedule
from colibri.mavlink.telemetry.encoder import Encoder
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import Message, Refusal, mav

Provider: TypeAlias = Callable[[ReceivedCommand], list[Send] | Refusal]
"""Answers or refuses REQUEST_MESSAGE for another service's message, by the command's param2 to param6."""

MIN_INTERVAL_US = 1_000
MIN_GROUP_INTERVAL_US = 20_000  # all groups at frame rate would take computing time from the control law
MAX_INTERVAL_US = 2**31 - 1
MAX_STREAMED = 128  # between two frames of the plant; the others are late, and rates decrease for all
DISABLED = -1.0
DEFAULT = 0.0
HEARTBEAT_US = 1_000_000
NOT_AVAILABLE = 0  # the interval in MESSAGE_INTERVAL, as PX4 and ArduPilot send it
MAX_MESSAGE_ID = 0xFFFF  # that fits in MESSAGE_INTERVAL
MAX_WAITING = 256  # limit of requested messages between two frames of the plant; more are rejected temporarily

_OLD_REQUESTS = {
    "MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES": "AUTOPILOT_VERSION",
    "MAV_CMD_REQUEST_FLIGHT_INFORMATION": "FLIGHT_INFORMATION",
    "MAV_CMD_GET_HOME_POSITION": "HOME_POSITION",
    "MAV_CMD_REQUEST_STORAGE_INFORMATION": "STORAGE_INFORMATION",
}
"""Predecessors of REQUEST_MESSAGE."""


class StreamService:
    """Streams telemetry to every channel at its own rates, and sends messages on request."""

    handles = frozenset({"REQUEST_DATA_STREAM"})

    def __init__(self, telemetry: Mapping[str, Encoder], streams: Streams = PX4_STREAMS) -> None:
        self._telemetry, self._streams = dict(telemetry), streams
        self._spread = {name: number for number, name in enumerate(telemetry)}
        self._names = {_message_id(name): name for name in telemetry}
        self._providers: dict[int, Provider] = {
            mav.MAVLINK_MSG_ID_MESSAGE_INTERVAL: lambda asked: self._report_interval(asked.p2, asked.peer) or []
        }
        self._schedule = Schedule()
        self._kinds: dict[int, str] = {}
        self._open: set[int] = set()
        self._waiting: list[Send] = []
        self._snapshot: TelemetrySnapshot | None = None
        self._encoded: dict[str, list[Fields]] = {}
        self._now_us = 0

    def provide(self, name: str, provider: Provider) -> None:
        message_id = _message_id(name)
        assert message_id >= 0, name
        self._providers[message_id] = provider

    def update(self, snapshot: TelemetrySnapshot) -> None:
        self._snapshot = snapshot
        if self._encoded:
            self._encoded = {}

    def use(self, channel: int, kind: str) -> None:
        self._kinds[channel] = kind
        if channel in self._open:
            self._restart(channel, self._now_us)

    def opened(self, channel: int, now_us: int) -> None:
        self._open.add(channel)
        self._restart(channel, now_us)

    def closed(self, channel: int) -> None:
        self._open.discard(channel)
        self._kinds.pop(channel, None)
        for name in self._telemetry:
            self._schedule.drop((channel, name))
        self._waiting = [send for send in self._waiting if send.channel != channel]

    def interval_us(self, channel: int, name: str) -> int | None:
        return self._schedule.interval_us((channel, name))

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        fields = message.fields
        self.set_group(peer.channel, fields.req_stream_id, fields.req_message_rate if fields.start_stop else 0, now_us)
        return ()

    @property
    def channels(self) -> frozenset[int]:
        return frozenset(self._open)

    def set_group(self, channel: int, number: int, rate_hz: float, now_us: int) -> None:
        """Send a group of MAV_DATA_STREAM on a channel at a rate; 0 stops it."""
        groups, every = self._streams.groups, number == mav.MAV_DATA_STREAM_ALL
        names = [name for group in groups.values() for name in group] if every else groups.get(number, ())
        interval_us = max(MIN_GROUP_INTERVAL_US, round(1e6 / rate_hz)) if rate_hz else None
        for name in names:
            self._set(channel, name, interval_us, now_us)

    def poll(self, now_us: int) -> Iterable[Send]:
        self._now_us = now_us
        due = self._schedule.due(now_us, MAX_STREAMED)
        if not due and not self._waiting:
            return ()
        sends, self._waiting = self._waiting, []
        for channel, name in due:
            sends.extend([Send(name, fields, channel) for fields in self.encode(name)])
        return sends

    def handlers(self) -> dict[int, Handler]:
        commands: dict[int, Handler] = {
            mav.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mav.MAV_CMD_GET_MESSAGE_INTERVAL: lambda command: self._report_interval(command.p1, command.peer),
            mav.MAV_CMD_REQUEST_MESSAGE: lambda command: self._request(_whole(command.p1), command),
        }
        for command, name in _OLD_REQUESTS.items():
            commands[getattr(mav, command)] = self._request_of(name)
        return commands

    def _set_message_interval(self, command: ReceivedCommand) -> Refusal | None:
        """Set the interval, µs: -1 off, 0 default."""
        message_id, interval_us = _whole(command.p1), command.p2
        name = self._names.get(message_id)
        if name is None:
            result = self._streams.unstreamed[not self._is_known(message_id)]
            return Refusal(f"interval refused: {_named(message_id, command.p1)} is not streamed", result)
        if interval_us == DISABLED:
            self._set(command.peer.channel, name, None, command.now_us)
        elif interval_us == DEFAULT:
            self._set(command.peer.channel, name, self._default(command.peer.channel, name), command.now_us)
        elif 0.0 < interval_us <= MAX_INTERVAL_US:
            whole_us = max(MIN_INTERVAL_US, round(interval_us))
            self._set(command.peer.channel, name, whole_us, command.now_us)
        else:
            return Refusal(f"interval of {name} refused: {interval_us:g} is not within 1 to {MAX_INTERVAL_US} us")
        return None

    def _report_interval(self, asked: float, peer: Peer) -> Refusal | None:
        message_id = _whole(asked)
        if message_id == mav.MAVLINK_MSG_ID_HEARTBEAT:
            interval_us = HEARTBEAT_US
        elif message_id in self._names:
            interval_us = self.interval_us(peer.channel, self._names[message_id]) or -1
        elif self._is_known(message_id):
            interval_us = -1
        else:
            if 0 <= message_id <= MAX_MESSAGE_ID:
                self._post([to(peer, "MESSAGE_INTERVAL", message_id, NOT_AVAILABLE)])
            return Refusal(f"no interval: {_named(message_id, asked)} is not streamed", UNSUPPORTED)
        return self._post([to(peer, "MESSAGE_INTERVAL", message_id, interval_us)])

    def _request_of(self, name: str) -> Handler:
        message_id = _message_id(name)
        return lambda command: self._request(message_id, command._replace(p1=float(message_id), p2=0.0))

    def _request(self, message_id: int, command: ReceivedCommand) -> Refusal | None:
        provider = self._providers.get(message_id)
        if provider is not None:
            answer = provider(command)
            return answer if isinstance(answer, Refusal) else self._post(answer)
        name = self._names.get(message_id)
        if name is None:
            return Refusal(f"request refused: {_named(message_id, command.p1)} is not sent", self._streams.unsent)
        sends = [to(command.peer, name, *fields) for fields in self.encode(name)]
        return self._post(sends) if sends else Refusal(f"{name} is not known yet", TEMPORARILY_REJECTED)

    def _post(self, sends: list[Send]) -> Refusal | None:
        if len(self._waiting) + len(sends) > MAX_WAITING:
            return Refusal(f"{len(self._waiting)} requested messages wait: ask again", TEMPORARILY_REJECTED)
        self._waiting.extend(sends)
        return None

    def encode(self, name: str) -> list[Fields]:
        """Return the fields of a message by the latest snapshot; none before the first."""
        encoded = self._encoded.get(name)
        if encoded is None:
            fields = None if self._snapshot is None else self._telemetry[name](self._snapshot)
            encoded = [] if fields is None else fields if isinstance(fields, list) else [fields]
            self._encoded[name] = encoded
        return encoded

    def _restart(self, channel: int, now_us: int) -> None:
        for name in self._telemetry:
            self._set(channel, name, self._default(channel, name), now_us)

    def _default(self, channel: int, name: str) -> int | None:
        kind = self._kinds.get(channel, GCS if channel in self._open else SILENT)
        return self._streams.defaults[kind].get(name)

    def _set(self, channel: int, name: str, interval_us: int | None, now_us: int) -> None:
        if name not in self._telemetry:
            return
        if interval_us is None:
            self._schedule.drop((channel, name))
        else:
            self._schedule.set((channel, name), interval_us, self._spread[name], now_us)

    def _is_known(self, message_id: int) -> bool:
        return message_id in self._providers or message_id == mav.MAVLINK_MSG_ID_HEARTBEAT


def _message_id(name: str) -> int:
    """Return the id of a message; -2 if the dialect lacks it."""
    number: int = getattr(mav, f"MAVLINK_MSG_ID_{name}", -2)
    return number


def _named(message_id: int, asked: float) -> str:
    definition = mav.mavlink_map.get(message_id)
    return f"message {asked:g}" if definition is None else f"{definition.msgname} ({message_id})"


def _whole(number: float) -> int:
    return int(number) if 0.0 <= number < 2**24 and number == int(number) else -1
