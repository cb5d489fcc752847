"""Counts of rejected values."""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType


class RejectedSource(StrEnum):
    """Source of a rejected value; optional sensors use names."""

    CLOCK = "clock"
    ACCELEROMETER = "accelerometer"
    GYROSCOPE = "gyroscope"
    MAGNETOMETER = "magnetometer"
    BAROMETER = "barometer"
    GPS = "gps"


class Reason(StrEnum):
    NOT_FINITE = "not finite"
    RANGE = "out of range"
    FROZEN = "frozen"
    TIME = "time"
    NO_FIX = "no fix"
    FIELD = "not the field of the earth"
    INNOVATION = "innovation"


Rejections = Mapping[tuple[str, Reason], int]


class Rejected:
    def __init__(self) -> None:
        self._counts: dict[tuple[str, Reason], int] = {}
        self._published: Rejections = MappingProxyType({})

    def add(self, source: str, reason: Reason) -> None:
        key = (source, reason)
        self._counts[key] = self._counts.get(key, 0) + 1
        self._published = MappingProxyType(dict(self._counts))

    @property
    def counts(self) -> Rejections:
        return self._published
