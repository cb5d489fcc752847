"""Phases of a companion: a table whose first row that holds applies, and its conditions."""

from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

from colibri.companion.supervision.rules import FlightFacts, Rule


class CompanionPhase(StrEnum):
    CONNECTING = "connecting"
    CHECKING = "checking"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    TAKING_OVER = "taking over"
    FLYING = "flying"
    HANDING_OVER = "handing over"
    ENDED = "ended"


class PhaseCondition(StrEnum):
    """Condition of a transition, as the user reads it."""

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


WITHIN_S: dict[CompanionPhase, float] = {
    CompanionPhase.ARMING: 10.0,
    CompanionPhase.TAKING_OFF: 40.0,
    CompanionPhase.TAKING_OVER: 5.0,
    CompanionPhase.HANDING_OVER: 10.0,
}
"""Timeout of each phase."""


class CompanionEnd(NamedTuple):
    """How it ended; `in_order` if it was completed or ended by the pilot."""

    in_order: bool
    why: str


def how_it_ended(
    before: CompanionPhase, why: PhaseCondition, limit: Rule[FlightFacts] | None, fault: str, waits_for: Sequence[str]
) -> CompanionEnd:
    """Judge an ending; `fault` is a refusal or an error, `waits_for` what was missing on the ground."""
    if limit is not None:
        return CompanionEnd(False, f"ended by its limit: {limit.name}")
    if fault:
        return CompanionEnd(False, fault)
    if why is PhaseCondition.PILOT:
        return CompanionEnd(True, "the pilot, or the vehicle itself, has chosen another mode: it is theirs")
    if why is PhaseCondition.TOO_LATE:
        return CompanionEnd(False, ": ".join((f"{before}: timed out", *filter(None, ["; ".join(waits_for)]))))
    return CompanionEnd(why is not PhaseCondition.DISARMED or before is CompanionPhase.HANDING_OVER, why.value)
