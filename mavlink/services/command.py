"""The command microservice: COMMAND_LONG and COMMAND_INT, answered by COMMAND_ACK."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from mavlink.dialect import mav
from mavlink.services.service import Peer

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED: int = mav.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = mav.MAV_RESULT_DENIED
UNSUPPORTED: int = mav.MAV_RESULT_UNSUPPORTED
FAILED: int = mav.MAV_RESULT_FAILED
IN_PROGRESS: int = mav.MAV_RESULT_IN_PROGRESS
CANCELLED: int = mav.MAV_RESULT_CANCELLED


class Command(NamedTuple):
    """A command, COMMAND_LONG and COMMAND_INT alike.

    Attributes:
        id: MAV_CMD.
        p1: First parameter.
        p2: Second parameter.
        p3: Third parameter.
        p4: Fourth parameter.
        x: Fifth: in degrees where it is a latitude, nan where a COMMAND_INT does not give it (INT32_MAX).
        y: Sixth: likewise.
        z: Seventh.
        frame: MAV_FRAME of a COMMAND_INT; None of a COMMAND_LONG.
        peer: Who asks.
        now_us: Simulated time.
    """

    id: int
    p1: float
    p2: float
    p3: float
    p4: float
    x: float
    y: float
    z: float
    frame: int | None
    peer: Peer
    now_us: int


class Outcome(NamedTuple):
    """What became of a command.

    Attributes:
        result: MAV_RESULT.
        reason: Why it was refused, for the STATUSTEXT that goes with the COMMAND_ACK; empty for none.
        param2: COMMAND_ACK.result_param2.
    """

    result: int = ACCEPTED
    reason: str = ""
    param2: int = 0


Handler: TypeAlias = Callable[[Command], Outcome]
"""Obeys one kind of command. Must check every parameter that it uses: they may be anything."""
