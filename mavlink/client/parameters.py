"""Parameters of a vehicle, read, set and listed: https://mavlink.io/en/services/parameter.html.

A value travels in a 32-bit float: integers byte by byte (`by_bits`: PX4, Colibri) or as a number (ArduPilot).
"""

from collections.abc import Sequence
from math import isfinite
from struct import Struct
from struct import error as StructError  # noqa: N812
from typing import Any, NamedTuple

from colibri.mavlink.client.conversation import OK, USUALLY, Conversation, Encoded, Repeat, Target
from colibri.mavlink.parameters.store import ParamError, Value
from colibri.mavlink.wire.dialect import Bits, Message, mav, param_bits

DIFFERS = -2  # the result of a change if the vehicle still reports another value
_BELIEVED_AFTER = 3  # requests before a different value counts: it may have been sent before the change
_GAPS_AT_ONCE = 10
_BY_NAME = -1
_REAL: int = mav.MAV_PARAM_TYPE_REAL32
_INTEGERS = ("<Bxxx", "<bxxx", "<Hxx", "<hxx", "<I", "<i")  # in the order of MAV_PARAM_TYPE
_LAYOUTS = dict(enumerate(map(Struct, _INTEGERS), start=mav.MAV_PARAM_TYPE_UINT8)) | {_REAL: Struct("<f")}


class Held(NamedTuple):
    value: Value
    kind: int  # MAV_PARAM_TYPE


def held_in(message: Message, *, by_bits: bool = True) -> Held:
    kind = message.fields.param_type
    layout = _LAYOUTS.get(kind)
    if layout is not None and (by_bits or kind == _REAL):
        (value,) = layout.unpack(param_bits(message).to_bytes(4, "little"))
        return Held(value, kind)
    value = message.fields.param_value
    return Held(round(value) if kind != _REAL and isfinite(value) else value, kind)


def on_wire(value: Value, kind: int, *, by_bits: bool = True) -> Bits | float:
    """Return a value as in PARAM_SET, integers rounded; raise `ValueError` if the type cannot hold it."""
    layout = _LAYOUTS.get(kind)
    if layout is None or (not by_bits and kind != _REAL):
        return float(round(value))
    try:
        packed = layout.pack(float(value) if kind == _REAL else round(value))
    except (OverflowError, StructError) as error:
        raise ValueError(f"{value!r} is beyond a parameter of MAV_PARAM_TYPE {kind}") from error
    return Bits(int.from_bytes(packed, "little"))


class ReadParameter(Conversation):
    """Read one parameter into `held`; `result` is OK or a MAV_PARAM_ERROR."""

    answers = frozenset({"PARAM_VALUE", "PARAM_ERROR"})

    def __init__(self, target: Target, name: str, *, by_bits: bool = True, repeat: Repeat = USUALLY) -> None:
        super().__init__(target, ("parameter", name), repeat)
        self.name = name
        self.held: Held | None = None
        self._by_bits = by_bits

    def _read(self, message: Message) -> None:
        if message.fields.param_id != self.name:
            return
        if message.name == "PARAM_ERROR":
            self.result = message.fields.error
            return
        self.held = held_in(message, by_bits=self._by_bits)
        self._compare()

    def _compare(self) -> None:
        self.result = OK

    def _request(self) -> Sequence[Encoded]:
        return (("PARAM_REQUEST_READ", (*self.target, self.name, _BY_NAME)),)


class SetParameter(ReadParameter):
    """Set one parameter; `result` is OK, a MAV_PARAM_ERROR, or DIFFERS. An unknown type is read first."""

    def __init__(
        self,
        target: Target,
        name: str,
        value: Value,
        *,
        kind: int | None = None,
        by_bits: bool = True,
        repeat: Repeat = USUALLY,
    ) -> None:
        super().__init__(target, name, by_bits=by_bits, repeat=repeat)
        self._kind = kind
        self._value = value

    def _compare(self) -> None:
        assert self.held is not None, "it was just read"
        if self._kind is None:
            self._kind = self.held.kind
            try:
                on_wire(self._value, self._kind, by_bits=self._by_bits)
            except ValueError:
                self.result = ParamError.VALUE_OUT_OF_RANGE
            self._go_on()
        elif self.held.kind != self._kind:
            self.result = ParamError.TYPE_MISMATCH
        elif self._wire(self.held.value) == self._wire(self._value):
            self.result = OK
        elif self._sent >= _BELIEVED_AFTER:
            self.result = DIFFERS

    def _wire(self, value: Value) -> Any:
        assert self._kind is not None, "it was read or given"
        return on_wire(value, self._kind, by_bits=self._by_bits)

    def _request(self) -> Sequence[Encoded]:
        if self._kind is None:
            return super()._request()
        return (("PARAM_SET", (*self.target, self.name, self._wire(self._value), self._kind)),)


class ListParameters(Conversation):
    """Read all parameters into `held`; lost ones are requested one by one."""

    answers = frozenset({"PARAM_VALUE"})

    def __init__(self, target: Target, *, by_bits: bool = True, repeat: Repeat = USUALLY) -> None:
        super().__init__(target, "parameter list", repeat)
        self.held: dict[str, Held] = {}
        self.count: int | None = None
        self._missing: set[int] = set()
        self._by_bits = by_bits

    def _read(self, message: Message) -> None:
        fields = message.fields
        if self.count is None:
            self.count = fields.param_count
            self._missing = set(range(fields.param_count))
        self.held[fields.param_id] = held_in(message, by_bits=self._by_bits)
        if fields.param_index in self._missing:
            self._missing.remove(fields.param_index)
            self._wait(self._repeat.every_us)
        if not self._missing:
            self.result = OK

    def _request(self) -> Sequence[Encoded]:
        if self.count is None:
            return (("PARAM_REQUEST_LIST", self.target),)
        gaps = sorted(self._missing)[:_GAPS_AT_ONCE]
        return [("PARAM_REQUEST_READ", (*self.target, "", index)) for index in gaps]
