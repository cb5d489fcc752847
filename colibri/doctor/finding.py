"""What a check of this computer found."""

from enum import StrEnum
from typing import NamedTuple


class Verdict(StrEnum):
    """What a finding means for a flight."""

    FINE = "fine"
    NOTE = "note"
    """A flight works; what is said may be worth knowing."""
    FAILED = "failed"
    """No flight could work, or none that a ground station sees."""


class Finding(NamedTuple):
    """What a check found.

    Attributes:
        checked: What was looked at.
        verdict: What it means.
        found: What is there.
        advice: What to do about it; empty where there is nothing to do.
    """

    checked: str
    verdict: Verdict
    found: str
    advice: str = ""
