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
    before: CompanionPhase, why: PhaseCondition, limit: Limit | None, refused: str, failing: Sequence[str]
) -> CompanionEnd:
    if why is PhaseCondition.PILOT:
        return CompanionEnd(True, "the pilot, or the vehicle itself, has chosen another mode: it is theirs")
    if limit is not None:
        return CompanionEnd(False, f"ended by its limit: {limit.name}")
    if refused:
        return CompanionEnd(False, refused)
    if why is PhaseCondition.TOO_LATE:
        return CompanionEnd(
            False, "; ".join(failing) if before is CompanionPhase.CHECKING else f"nothing came of {before} in time"
        )
    return CompanionEnd(why is not PhaseCondition.DISARMED or before is CompanionPhase.HANDING_OVER, why.value)
