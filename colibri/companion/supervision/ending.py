"""How a flight by a companion ended."""

from collections.abc import Sequence
from typing import NamedTuple

from colibri.companion.supervision.limits import Limit
from colibri.companion.supervision.phases import Condition, Phase


class Ended(NamedTuple):
    """How it ended; `in_order` if the flight was completed, or ended by someone entitled to."""

    in_order: bool
    why: str


def how_it_ended(before: Phase, why: Condition, limit: Limit | None, refused: str, failing: Sequence[str]) -> Ended:
    if why is Condition.PILOT:
        return Ended(True, "the pilot, or the vehicle itself, has chosen another mode: it is theirs")
    if limit is not None:
        return Ended(False, f"ended by its limit: {limit.name}")
    if refused:
        return Ended(False, refused)
    if why is Condition.TOO_LATE:
        return Ended(False, "; ".join(failing) if before is Phase.CHECKING else f"nothing came of {before} in time")
    return Ended(why is not Condition.DISARMED or before is Phase.HANDING_OVER, why.value)
