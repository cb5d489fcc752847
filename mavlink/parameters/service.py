"""The parameter microservice of the vehicle: https://mavlink.io/en/services/parameter.html."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite

from colibri.mavlink.node.service import IDLE, Peer, Send, to
from colibri.mavlink.parameters.store import ParamError, Parameter, Parameters, ParamType, Value, bits_of, value_of
from colibri.mavlink.services.statustext import WARNING, StatusText
from colibri.mavlink.wire.dialect import Bits, Message, param_bits

INTERVAL_US = 2_000  # between two parameters of a list: 150 take 0.3 s
MAX_AT_ONCE = 20
BY_ID = -1  # param_index of a request by name
_NOT_EXACT_IN_FLOAT = 2**24  # from here on, a float may stand for two integers


@dataclass(slots=True)
class _Listing:
    """A list being sent: next parameter, number left, time of the last one."""

    index: int
    left: int
    last_us: int


class ParameterService:
    """Lists, reads and sets parameters."""

    handles = frozenset({"PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"})

    def __init__(self, parameters: Parameters, text: StatusText, *, as_floats: bool = False) -> None:
        """Serve `parameters`; `as_floats` has values as floats, and unknown names unanswered."""
        self._parameters, self._text, self._as_floats = parameters, text, as_floats
        self._listings: dict[int, _Listing] = {}
        self._proposed: dict[str, list[Peer]] = {}  # who waits for `Parameters.settle`

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        fields = message.fields
        if message.name == "PARAM_REQUEST_LIST":
            listing = self._listings.setdefault(peer.channel, _Listing(0, 0, now_us))
            listing.left = len(self._parameters)
            return ()
        if message.name == "PARAM_REQUEST_READ":
            return self._read(fields.param_id, fields.param_index, peer)
        return self._set(fields.param_id, fields.param_type, param_bits(message), peer)

    def poll(self, now_us: int) -> Iterable[Send]:
        """Send the due parameters of each list: "allow breaks between each message"."""
        if not self._listings and not self._proposed:
            return IDLE
        sends = [send for channel in tuple(self._listings) for send in self._go_on(channel, now_us)]
        settled = self._parameters.settled
        for name, refusal in settled[:MAX_AT_ONCE]:
            sends += self._answers(name, refusal)
        del settled[:MAX_AT_ONCE]
        return sends

    def _answers(self, name: str, refusal: ParamError | None) -> Iterator[Send]:
        index = self._parameters.index(name)
        assert index is not None, "only known parameters are proposed"
        for peer in self._proposed.pop(name, ()):
            if refusal is not None:
                yield _refuse(peer, name, index, refusal)
        yield self._value(index)

    def _go_on(self, channel: int, now_us: int) -> list[Send]:
        listing = self._listings[channel]
        listing.last_us = min(listing.last_us, now_us)  # simulated time can restart
        due = (now_us - listing.last_us) // INTERVAL_US
        listing.last_us += due * INTERVAL_US
        sends = []
        for _ in range(min(due, listing.left, MAX_AT_ONCE)):
            sends.append(self._value(listing.index, channel))
            listing.index = (listing.index + 1) % len(self._parameters)
            listing.left -= 1
        if listing.left == 0:
            del self._listings[channel]
        return sends

    def _read(self, name: str, index: int, peer: Peer) -> Iterable[Send]:
        if index == BY_ID:
            known = self._parameters.index(name)
        else:
            known = None if self._parameters.at(index) is None else index
        if known is None:
            return self._unknown(peer, name, index)
        if name in self._proposed:  # its value is sent as soon as it is settled
            return ()
        return (self._value(known, peer.channel),)

    def _set(self, name: str, wire_type: int, bits: int, peer: Peer) -> Iterable[Send]:
        index = self._parameters.index(name)
        definition = None if index is None else self._parameters.at(index)
        if index is None or definition is None:
            told = () if self._as_floats else self._text.say(WARNING, f"{name} not changed: there is no such parameter")
            return (*self._unknown(peer, name, BY_ID), *told)
        value = _number(definition, bits) if self._as_floats else _meant(definition, wire_type, bits)
        outcome = value if isinstance(value, ParamError) else self._parameters.propose(name, value)
        if isinstance(outcome, ParamError):
            told = self._text.say(WARNING, f"{name} not changed: {_reason(definition, value, outcome)}")
            return (_refuse(peer, name, index, outcome), self._value(index), *told)
        if not outcome:
            return (self._value(index),)
        self._proposed.setdefault(name, []).append(peer)
        return ()

    def _unknown(self, peer: Peer, name: str, index: int) -> Iterable[Send]:
        return () if self._as_floats else (_refuse(peer, name, index, ParamError.DOES_NOT_EXIST),)

    def _value(self, index: int, channel: int | None = None) -> Send:
        definition = self._parameters.at(index)
        assert definition is not None, "indices are checked where they come from"
        kind = ParamType.REAL if self._as_floats else definition.kind
        bits = Bits(bits_of(kind, self._parameters[definition.name]))
        fields = (definition.name, bits, definition.wire or definition.kind, len(self._parameters), index)
        return Send("PARAM_VALUE", fields, channel)


def _meant(definition: Parameter, wire_type: int, bits: int) -> Value | ParamError:
    """Return the value of a PARAM_SET; integers may come as REAL32, as from MAVProxy and DroneKit."""
    if wire_type not in tuple(ParamType):
        return ParamError.TYPE_UNSUPPORTED
    value = value_of(ParamType(wire_type), bits)
    if wire_type == definition.kind:
        return value
    if isinstance(value, float) and value.is_integer() and abs(value) < _NOT_EXACT_IN_FLOAT:
        return int(value)
    return ParamError.TYPE_MISMATCH


def _number(definition: Parameter, bits: int) -> Value | ParamError:
    """Return the number of a PARAM_SET that is a float whatever its type says."""
    value = value_of(ParamType.REAL, bits)
    if definition.kind == ParamType.REAL:
        return value
    return round(value) if isfinite(value) else ParamError.VALUE_OUT_OF_RANGE


def _reason(definition: Parameter, value: Value | ParamError, refusal: ParamError) -> str:
    if refusal is not ParamError.VALUE_OUT_OF_RANGE or isinstance(value, ParamError):
        return refusal.name.lower().replace("_", " ")
    choices = ", ".join(str(choice) for choice, _ in definition.values)
    return f"{value:g} is not {choices or f'within {definition.minimum:g} to {definition.maximum:g}'}"


def _refuse(peer: Peer, name: str, index: int, refusal: ParamError) -> Send:
    return to(peer, "PARAM_ERROR", peer.system, peer.component, name, index, refusal)
