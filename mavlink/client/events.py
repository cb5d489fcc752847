"""Events at given times: their base, and those that a ground station sends."""

from typing import Annotated, ClassVar, TypeAlias

import msgspec

from colibri.common.types import Vector
from colibri.mavlink.errors import MavlinkError


class EventError(MavlinkError):
    """An event is unknown, invalid, or impossible in this flight."""


class TimedEvent(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True, tag_field="event"
):
    """An event at `t`, s; FORM is its value as text."""

    FORM: ClassVar[str]
    t: Annotated[float, msgspec.Meta(ge=0.0)]

    @property
    def kind(self) -> str:
        return str(self.__struct_config__.tag)


class Mode(TimedEvent, frozen=True, tag="mode"):
    """Select a flight mode, from a ground station; then arm, if asked."""

    FORM = "MODE[,arm]"
    mode: str
    arm: bool = False


class Setpoint(TimedEvent, frozen=True, tag="setpoint"):
    """Send this offboard set-point, ENU, from `t` s on, at 20 Hz, until the next one or the next mode."""

    FORM = "EAST,NORTH,UP"
    position: Vector | None = None
    velocity: Vector | None = None
    yaw: float | None = None


StationEvent: TypeAlias = Mode | Setpoint
