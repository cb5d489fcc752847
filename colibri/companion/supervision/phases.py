"""Phases of a companion: one table, and a pure function over it. The first row whose condition holds applies."""

from enum import StrEnum
from typing import NamedTuple


class Phase(StrEnum):
    """Activity of a companion."""

    CONNECTING = "connecting"
    CHECKING = "checking"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    TAKING_OVER = "taking over"
    FLYING = "flying"
    HANDING_OVER = "handing over"
    ENDED = "ended"


class Condition(StrEnum):
    """Condition of a transition; its value is the message to the user."""

    CONNECTED = "the vehicle is known"
    STOPPED = "it was told to end"
    PILOT = "the pilot has chosen another mode"
    DISARMED = "the rotors have stopped"
    MUST_END = "a limit is exceeded"
    CHECKED_TO_ARM = "all is checked, and it may arm"
    CHECKED_IN_AIR = "all is checked, and the vehicle flies"
    ARMED = "the rotors turn"
    UP = "it is up there, and stays"
    OFFBOARD = "the vehicle takes setpoints"
    FINISHED = "the track is flown, or the time is up"
    HELD = "the vehicle holds by itself"
    TOO_LATE = "nothing came of it in time"


class Row(NamedTuple):
    """A transition."""

    sources: tuple[Phase, ...]
    condition: Condition
    target: Phase


_GROUND = (Phase.CONNECTING, Phase.CHECKING)
_CLIMBS = (Phase.ARMING, Phase.TAKING_OFF)
_FLIES = (Phase.TAKING_OVER, Phase.FLYING)

TABLE: tuple[Row, ...] = (
    Row(_GROUND, Condition.STOPPED, Phase.ENDED),
    Row((*_CLIMBS, *_FLIES, Phase.HANDING_OVER), Condition.PILOT, Phase.ENDED),
    Row((Phase.TAKING_OFF, *_FLIES, Phase.HANDING_OVER), Condition.DISARMED, Phase.ENDED),
    Row((*_CLIMBS, *_FLIES), Condition.STOPPED, Phase.HANDING_OVER),
    Row((Phase.TAKING_OFF, *_FLIES), Condition.MUST_END, Phase.HANDING_OVER),
    Row((Phase.CONNECTING,), Condition.CONNECTED, Phase.CHECKING),
    Row((Phase.CHECKING,), Condition.FINISHED, Phase.ENDED),
    Row((Phase.CHECKING,), Condition.CHECKED_IN_AIR, Phase.TAKING_OVER),
    Row((Phase.CHECKING,), Condition.CHECKED_TO_ARM, Phase.ARMING),
    Row((Phase.ARMING,), Condition.ARMED, Phase.TAKING_OFF),
    Row((Phase.TAKING_OFF,), Condition.UP, Phase.TAKING_OVER),
    Row((Phase.TAKING_OVER,), Condition.OFFBOARD, Phase.FLYING),
    Row((Phase.FLYING,), Condition.FINISHED, Phase.HANDING_OVER),
    Row((Phase.HANDING_OVER,), Condition.HELD, Phase.ENDED),
    Row((*_GROUND, Phase.HANDING_OVER), Condition.TOO_LATE, Phase.ENDED),
    Row((*_CLIMBS, Phase.TAKING_OVER), Condition.TOO_LATE, Phase.HANDING_OVER),
)


def next_phase(phase: Phase, conditions: frozenset[Condition]) -> tuple[Phase, Condition | None]:
    for row in TABLE:
        if phase in row.sources and row.condition in conditions:
            return row.target, row.condition
    return phase, None
