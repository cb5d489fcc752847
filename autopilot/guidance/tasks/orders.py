"""Orders: the next thing to fly, by a mission's item, a command, or a mode."""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeAlias

import msgspec

from colibri.common.types import Vector


class GoTo(NamedTuple):
    """Fly to a place and stay there.

    Attributes:
        position_enu_m: The place, m, ENU.
        yaw_rad: Heading, counter-clockwise from east; None: along the way there.
        speed_m_s: None: the cruise speed.
    """

    position_enu_m: Vector
    yaw_rad: float | None = None
    speed_m_s: float | None = None


class Circle(NamedTuple):
    """Fly around a centre.

    Attributes:
        center_enu_m: The centre, at the height to fly at, m, ENU.
        radius_m: Positive flies clockwise seen from above, negative counter-clockwise.
        speed_m_s: Along the circle; None: the cruise speed.
        yaw_behaviour: ORBIT_YAW_BEHAVIOUR.
    """

    center_enu_m: Vector
    radius_m: float
    speed_m_s: float | None = None
    yaw_behaviour: int = 0


class TakeOff(NamedTuple):
    """Fly straight up.

    Attributes:
        height_enu_m: z to reach, m.
        yaw_rad: Heading, counter-clockwise from east; None: as it is.
    """

    height_enu_m: float
    yaw_rad: float | None = None


class Land(NamedTuple):
    """Sink until the ground is reached.

    Attributes:
        position_enu_m: Where, m, ENU; None: here.
        yaw_rad: Heading, counter-clockwise from east; None: as it is.
    """

    position_enu_m: Vector | None = None
    yaw_rad: float | None = None


class Return(NamedTuple):
    """Climb, fly home, land."""


class Hold(NamedTuple):
    """Stop, and stay where that is."""


Order: TypeAlias = GoTo | Circle | TakeOff | Land | Return | Hold
_KINDS: Mapping[str, type[Order]] = {kind.__name__: kind for kind in (GoTo, Circle, TakeOff, Land, Return, Hold)}


class OrderRecord(NamedTuple):
    """An order as plain data: the name of its class, and its fields."""

    kind: str
    fields: tuple[Any, ...]


def record_of(order: Order) -> OrderRecord:
    """Return an order as plain data."""
    return OrderRecord(type(order).__name__, tuple(order))


def order_of(record: OrderRecord) -> Order:
    """Return the order of this record; Hold where there is none such."""
    try:
        return msgspec.convert(record.fields, _KINDS[record.kind])
    except (KeyError, msgspec.ValidationError):
        return Hold()
