"""The finding of a check."""

from enum import StrEnum
from typing import NamedTuple


class Severity(StrEnum):
    """The meaning of a finding for a flight."""

    FINE = "fine"
    NOTE = "note"
    """Flights work, with a remark."""
    FAILED = "failed"
    """Flights cannot work, or not with a ground station."""


class Finding(NamedTuple):
    """The finding of a check, with advice unless all is well."""

    checked: str
    verdict: Severity
    found: str
    advice: str = ""
