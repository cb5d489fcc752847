"""A refusal: why a request is not carried out, in words and as a MAV_RESULT."""

from typing import NamedTuple

from colibri.mavlink.wire.dialect import RESULT_DENIED


class Refusal(NamedTuple):
    """Why something is not done. What is done returns None, or what came of it, instead.

    Attributes:
        reason: In words, as a ground station shows them; empty where the result suffices.
        result: MAV_RESULT.
    """

    reason: str = ""
    result: int = RESULT_DENIED
