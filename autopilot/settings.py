"""Strict tables: what profiles and control laws read their numbers into."""

from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Any, TypeAlias, TypeVar

import msgspec

from plant.vehicle import Positive

Negative: TypeAlias = Annotated[float, msgspec.Meta(lt=0.0)]
Degrees: TypeAlias = Annotated[float, msgspec.Meta(gt=0.0, lt=90.0)]
Count: TypeAlias = Annotated[int, msgspec.Meta(ge=1, le=1000)]
ControlInterval: TypeAlias = Annotated[float, msgspec.Meta(ge=0.001, le=1.0)]
T = TypeVar("T")


class SettingsError(Exception):
    """A table with a missing, unknown or impossible key; the message names it."""


class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of numbers, every one of them finite."""

    def __post_init__(self) -> None:
        """Check what a range cannot say."""
        for key in self.__struct_fields__:
            value = getattr(self, key)
            numbers = value if isinstance(value, tuple) else (value,)
            if any(isinstance(number, float) and not isfinite(number) for number in numbers):
                raise ValueError(f"{key}: must be finite")


class QpSettings(Table, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The QP solver, by its name in qpsolvers."""

    solver: str
    tolerance: Positive
    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=100_000)] = 100_000
    """More count as a time-out."""


def read_settings(table: Mapping[str, Any], kind: type[T]) -> T:
    """Read a control law's table of a profile into a strict structure.

    Raises:
        SettingsError: A key is missing, unknown or impossible.
    """
    try:
        return msgspec.convert(dict(table), type=kind)
    except msgspec.ValidationError as reason:
        what, _, where = str(reason).partition(" - at `$.")
        raise SettingsError(f"{where.rstrip('`')}: {what}" if where else what) from reason


def interval_us(interval_s: float) -> int:
    """Return an interval in whole microseconds.

    Raises:
        SettingsError: It is not whole milliseconds, as MAVLink counts them.
    """
    if not (interval_s * 1000.0).is_integer():
        raise SettingsError(f"control_interval_s: must be whole milliseconds, not {interval_s}")
    return round(interval_s * 1e6)
