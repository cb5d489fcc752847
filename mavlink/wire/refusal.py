"""A refusal of a request, in words and as a MAV_RESULT."""

from typing import NamedTuple

from colibri.mavlink.wire.dialect import RESULT_DENIED


class Refusal(NamedTuple):
    """Reason of a refusal; empty if the result suffices."""

    reason: str = ""
    result: int = RESULT_DENIED  # MAV_RESULT
