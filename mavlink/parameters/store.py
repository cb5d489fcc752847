"""Parameters of a vehicle: definitions and values of 32 bits."""

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import copysign, inf, isfinite
from re import fullmatch
from struct import Struct
from typing import NamedTuple, TypeAlias

from colibri.mavlink.wire.dialect import mav

Value: TypeAlias = int | float  # an int of 32 bits, or a float exact in 32 bits

INT32_MIN, INT32_MAX = -(2**31), 2**31 - 1
FLOAT32_MAX = 3.4028234663852886e38
_NAME = "[A-Z][A-Z0-9_]{0,15}"
_MAX_BATCHES = 8  # with more, the last value that was proposed for a name counts
_INT, _REAL, _BITS = Struct("<i"), Struct("<f"), Struct("<I")


class ParamType(IntEnum):
    """MAV_PARAM_TYPE."""

    INT = mav.MAV_PARAM_TYPE_INT32
    REAL = mav.MAV_PARAM_TYPE_REAL32


class ParamError(IntEnum):
    """MAV_PARAM_ERROR, of which pymavlink defines only the first half."""

    DOES_NOT_EXIST = 1
    VALUE_OUT_OF_RANGE = 2
    PERMISSION_DENIED = 3
    READ_ONLY = 5
    TYPE_UNSUPPORTED = 6
    TYPE_MISMATCH = 7


class Prepared(NamedTuple):
    """An accepted change, with the object built to validate it, if any."""

    made: object | None = None


Prepare: TypeAlias = Callable[[Collection[str], Mapping[str, Value]], Prepared | ParamError]
"""(changed names, all new values) -> acceptance or refusal of a change; without side effects."""
Ready: TypeAlias = Callable[[Collection[str], Mapping[str, Value]], bool]
"""(changed names, all new values) -> whether `Prepare` may be called; if not, a slice of its work is done."""
Linked: TypeAlias = Callable[[Mapping[str, Value], Mapping[str, Value]], Mapping[str, Value]]
"""(changes, all values with them) -> further changes that follow from them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """Definition of a parameter. Numbers are rounded to 32 bits."""

    name: str  # at most 16 capitals, digits and underscores
    kind: ParamType
    default: Value
    minimum: Value = -FLOAT32_MAX
    maximum: Value = FLOAT32_MAX
    unit: str = ""
    decimals: int = 3  # for display
    description: str
    details: str = ""
    group: str = ""
    reboot_required: bool = False
    values: tuple[tuple[int, str], ...] = ()  # the valid ones with meanings, if not all
    read_only: bool = False
    wire: int = 0  # MAV_PARAM_TYPE on the wire, if it is not `kind`'s

    def __post_init__(self) -> None:
        if not fullmatch(_NAME, self.name):
            raise ValueError(f"{self.name}: no name of a parameter")
        if self.kind == ParamType.INT:
            object.__setattr__(self, "minimum", max(self.minimum, INT32_MIN))
            object.__setattr__(self, "maximum", min(self.maximum, INT32_MAX))
        else:
            for field in ("default", "minimum", "maximum"):
                object.__setattr__(self, field, float32(getattr(self, field)))
        if self.refusal(self.default) is not None:
            raise ValueError(f"{self.name}: its default {self.default} is not among the values that it may have")

    def refusal(self, value: Value) -> ParamError | None:
        if self.kind == ParamType.INT and not isinstance(value, int):
            return ParamError.TYPE_MISMATCH
        if not isfinite(value) or not self.minimum <= value <= self.maximum:
            return ParamError.VALUE_OUT_OF_RANGE
        if self.values and all(value != choice for choice, _ in self.values):
            return ParamError.VALUE_OUT_OF_RANGE
        return None


class Parameters:
    """Parameters sorted by name, and their values; `prepare` may refuse a change, `links` return what follows."""

    def __init__(
        self,
        definitions: Iterable[Parameter],
        prepare: Prepare | None = None,
        *,
        links: Linked | None = None,
        initial: Mapping[str, Value] = {},
    ) -> None:
        self._definitions = tuple(sorted(definitions, key=lambda parameter: parameter.name))
        self._index = {parameter.name: index for index, parameter in enumerate(self._definitions)}
        if len(self._index) < len(self._definitions):
            raise ValueError("two parameters have one name")
        self._initial = {parameter.name: parameter.default for parameter in self._definitions} | dict(initial)
        self._values, self._links = dict(self._initial), links
        self._followed: tuple[str, ...] = ()  # names of the last change's further changes
        self._made: object | None = None
        self.prepare = prepare
        self._ready: Ready | None = None
        self._begun = False  # whether a part of the work for the first batch was done
        self.proposed: deque[dict[str, Value]] = deque()  # batches that `settle` is to prepare
        self.settled: list[tuple[str, ParamError | None]] = []  # names and refusals of proposed changes
        self.revision = 0  # number of changes so far

    def trial(self, values: Mapping[str, Value]) -> "Parameters":
        trial = Parameters(self._definitions)
        trial.load(values)
        return trial

    def ask(self, prepare: Prepare, ready: Ready | None = None) -> None:
        self.prepare, self._ready = prepare, ready

    def __len__(self) -> int:
        return len(self._definitions)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self._definitions)

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def default(self, name: str) -> Value:
        return self._definitions[self._index[name]].default

    @property
    def values(self) -> Mapping[str, Value]:
        return dict(self._values)

    def at(self, index: int) -> Parameter | None:
        return self._definitions[index] if 0 <= index < len(self._definitions) else None

    def index(self, name: str) -> int | None:
        return self._index.get(name)

    def set(self, name: str, value: Value) -> ParamError | None:
        """Change a value, if valid and accepted by `prepare`; return the refusal."""
        wanted = self._wanted(name, value)
        return wanted if isinstance(wanted, ParamError) else self._try({name: wanted})

    def propose(self, name: str, value: Value) -> ParamError | bool:
        """Propose a change for `settle`; return the refusal, or whether it changes anything."""
        wanted = self._wanted(name, value)
        if isinstance(wanted, ParamError):
            return wanted
        if wanted == self._values[name] and not any(name in batch for batch in self.proposed):
            return False
        batches = len(self.proposed)
        if batches <= self._begun or (name in self.proposed[-1] and batches < _MAX_BATCHES):
            self.proposed.append({})
        self.proposed[-1][name] = wanted
        return True

    def settle(self) -> None:
        """Do a slice of work for a batch of proposed changes; halve a refused one."""
        batch = self.proposed[0]
        self._begun = self._ready is not None and not self._ready(batch, {**self._values, **batch})
        if self._begun:
            return
        self.proposed.popleft()
        refusal = self._try(batch)
        if refusal is None or len(batch) == 1:
            self.settled += [(name, refusal) for name in (*batch, *self._followed)]
            return
        changes, half = list(batch.items()), len(batch) // 2
        self.proposed.extendleft((dict(changes[half:]), dict(changes[:half])))

    def _wanted(self, name: str, value: Value) -> Value | ParamError:
        index = self._index.get(name)
        if index is None:
            return ParamError.DOES_NOT_EXIST
        definition = self._definitions[index]
        if definition.kind == ParamType.REAL:
            value = float32(value)
        if value == self._values[name] and isinstance(value, type(self._values[name])):
            return value
        return definition.refusal(value) or (ParamError.READ_ONLY if definition.read_only else value)

    def _try(self, changes: Mapping[str, Value]) -> ParamError | None:
        self._followed = ()
        if self._links is not None:
            further = self._links(changes, {**self._values, **changes})
            changes, self._followed = {**further, **changes}, tuple(further)
        changed = {name: value for name, value in changes.items() if value != self._values[name]}
        if not changed:
            return None
        prepared = self.prepare(changed, {**self._values, **changed}) if self.prepare is not None else Prepared()
        if isinstance(prepared, ParamError):
            return prepared
        if prepared.made is not None:
            self._made = prepared.made
        self.load(changed)
        return None

    def load(self, values: Mapping[str, Value]) -> None:
        """Set validated values at once, without calling `prepare`."""
        for name, value in values.items():
            if value != self._values[name]:
                self._values[name] = value
                self.revision += 1

    def reset(self) -> None:
        """Propose all initial values."""
        for name, value in self._initial.items():
            self.propose(name, value)

    def take_made(self) -> object | None:
        made, self._made = self._made, None
        return made


def float32(value: float) -> float:
    """Return the nearest 32-bit float; infinite on overflow."""
    try:
        (rounded,) = _REAL.unpack(_REAL.pack(value))
    except OverflowError:
        return copysign(inf, value)
    return float(rounded)


def bits_of(kind: ParamType, value: Value) -> int:
    (bits,) = _BITS.unpack(_INT.pack(value) if kind == ParamType.INT else _REAL.pack(value))
    return int(bits)


def value_of(kind: ParamType, bits: int) -> Value:
    (value,) = (_INT if kind == ParamType.INT else _REAL).unpack(_BITS.pack(bits))
    return int(value) if kind == ParamType.INT else float(value)
