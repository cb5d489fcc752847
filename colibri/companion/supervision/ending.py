"""How a flight by a companion ended."""

from collections.abc import Sequence
from typing import NamedTuple

from colibri.companion.supervision.limits import Limit
from colibri.companion.supervision.phases import CompanionPhase, PhaseCondition


class CompanionEnd(NamedTuple):
    """How it ended; `in_order` if the flight was completed, or ended by someone entitled to."""

    in_order: bool
    why: str


def how_it_ended(
    before: CompanionPhase, why: PhaseCondition, limit: Limit | None, fault: str, waits_for: Sequence[str]
) -> CompanionEnd:
    """Judge an ending; `fault` is a refusal, an emergency or an error, `waits_for` what was missing on the ground."""
    if limit is not None:
        return CompanionEnd(False, f"ended by its limit: {limit.name}")
    if fault:
        return CompanionEnd(False, fault)
    if why is PhaseCondition.PILOT:
        return CompanionEnd(True, "the pilot, or the vehicle itself, has chosen another mode: it is theirs")
    if why is PhaseCondition.TOO_LATE:
        return CompanionEnd(False, ": ".join((f"{before}: timed out", *filter(None, ["; ".join(waits_for)]))))
    return CompanionEnd(why is not PhaseCondition.DISARMED or before is CompanionPhase.HANDING_OVER, why.value)
