"""Orders of mission items, commands and modes."""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

import msgspec

from colibri.common.records import Record
from colibri.common.types import Vector


class GoTo(NamedTuple):
    """Fly to a place and stay; yaw None is along the way, speed None the cruise speed.

    `turn` is the way to turn: 1 counter-clockwise, -1 clockwise, 0 the shorter one. The vehicle arrives after `stay_s`.
    """

    position_enu_m: Vector
    yaw_rad: float | None = None
    speed_m_s: float | None = None
    turn: int = 0
    stay_s: float = 0.0


def turn_of(angle: float, way: float) -> int:
    """Return the turn of CONDITION_YAW's angle and direction; a negative angle has none."""
    return -int(way) if angle >= 0.0 else 0


class Orbit(NamedTuple):
    """Fly around a centre; positive radii are clockwise."""

    center_enu_m: Vector
    radius_m: float
    speed_m_s: float | None = None
    yaw_behaviour: int = 0


class TakeOff(NamedTuple):
    """Climb vertically; yaw None keeps the heading."""

    height_enu_m: float
    yaw_rad: float | None = None


class Land(NamedTuple):
    """Sink, by default here with the present heading."""

    position_enu_m: Vector | None = None
    yaw_rad: float | None = None


class Return(NamedTuple):
    """Climb, fly home, land."""


class Hold(NamedTuple):
    """Stop and stay."""


Order: TypeAlias = GoTo | Orbit | TakeOff | Land | Return | Hold
_KINDS: Mapping[str, type[Order]] = {kind.__name__: kind for kind in (GoTo, Orbit, TakeOff, Land, Return, Hold)}


class OrderRecord(Record, frozen=True):
    kind: str
    fields: tuple[Any, ...]


def record_of(order: Order) -> OrderRecord:
    return OrderRecord(type(order).__name__, tuple(order))


def order_of(record: OrderRecord) -> Order:
    """Return the order of a record; Hold if it is invalid."""
    try:
        return msgspec.convert(record.fields, _KINDS[record.kind])
    except (KeyError, msgspec.ValidationError):
        return Hold()
