"""Phases of a companion: one table, and a pure function over it. The first row whose condition holds applies."""

from enum import StrEnum
from typing import NamedTuple


class CompanionPhase(StrEnum):
    """Activity of a companion."""

    CONNECTING = "connecting"
    CHECKING = "checking"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    TAKING_OVER = "taking over"
    FLYING = "flying"
    HANDING_OVER = "handing over"
    ENDED = "ended"


class PhaseCondition(StrEnum):
    """Condition of a transition; its value is the message to the user."""

    CONNECTED = "the vehicle is known"
    STOPPED = "stopped"
    PILOT = "the pilot has chosen another mode"
    DISARMED = "the rotors have stopped"
    MUST_END = "a limit is exceeded"
    CHECKED_TO_ARM = "all is checked, and it may arm"
    CHECKED_IN_AIR = "all is checked, and the vehicle flies"
    ARMED = "the rotors turn"
    UP = "at height, holding"
    OFFBOARD = "the vehicle takes setpoints"
    FINISHED = "the track is flown, or the time is up"
    HELD = "the vehicle holds by itself"
    TOO_LATE = "timed out"


class PhaseTransition(NamedTuple):
    """A transition."""

    sources: tuple[CompanionPhase, ...]
    condition: PhaseCondition
    target: CompanionPhase


_GROUND = (CompanionPhase.CONNECTING, CompanionPhase.CHECKING)
_CLIMBS = (CompanionPhase.ARMING, CompanionPhase.TAKING_OFF)
_FLIES = (CompanionPhase.TAKING_OVER, CompanionPhase.FLYING)

TABLE: tuple[PhaseTransition, ...] = (
    PhaseTransition(_GROUND, PhaseCondition.STOPPED, CompanionPhase.ENDED),
    PhaseTransition((*_CLIMBS, *_FLIES, CompanionPhase.HANDING_OVER), PhaseCondition.PILOT, CompanionPhase.ENDED),
    PhaseTransition(
        (CompanionPhase.TAKING_OFF, *_FLIES, CompanionPhase.HANDING_OVER), PhaseCondition.DISARMED, CompanionPhase.ENDED
    ),
    PhaseTransition((*_CLIMBS, *_FLIES), PhaseCondition.STOPPED, CompanionPhase.HANDING_OVER),
    PhaseTransition((CompanionPhase.TAKING_OFF, *_FLIES), PhaseCondition.MUST_END, CompanionPhase.HANDING_OVER),
    PhaseTransition((CompanionPhase.CONNECTING,), PhaseCondition.CONNECTED, CompanionPhase.CHECKING),
    PhaseTransition((CompanionPhase.CHECKING,), PhaseCondition.FINISHED, CompanionPhase.ENDED),
    PhaseTransition((CompanionPhase.CHECKING,), PhaseCondition.CHECKED_IN_AIR, CompanionPhase.TAKING_OVER),
    PhaseTransition((CompanionPhase.CHECKING,), PhaseCondition.CHECKED_TO_ARM, CompanionPhase.ARMING),
    PhaseTransition((CompanionPhase.ARMING,), PhaseCondition.ARMED, CompanionPhase.TAKING_OFF),
    PhaseTransition((CompanionPhase.TAKING_OFF,), PhaseCondition.UP, CompanionPhase.TAKING_OVER),
    PhaseTransition((CompanionPhase.TAKING_OVER,), PhaseCondition.OFFBOARD, CompanionPhase.FLYING),
    PhaseTransition((CompanionPhase.FLYING,), PhaseCondition.FINISHED, CompanionPhase.HANDING_OVER),
    PhaseTransition((CompanionPhase.HANDING_OVER,), PhaseCondition.HELD, CompanionPhase.ENDED),
    PhaseTransition((*_GROUND, CompanionPhase.HANDING_OVER), PhaseCondition.TOO_LATE, CompanionPhase.ENDED),
    PhaseTransition((*_CLIMBS, CompanionPhase.TAKING_OVER), PhaseCondition.TOO_LATE, CompanionPhase.HANDING_OVER),
)


def next_phase(
    phase: CompanionPhase, conditions: frozenset[PhaseCondition]
) -> tuple[CompanionPhase, PhaseCondition | None]:
    for row in TABLE:
        if phase in row.sources and row.condition in conditions:
            return row.target, row.condition
    return phase, None
