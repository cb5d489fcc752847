"""Gather the conditions of the phase table from one situation."""

from math import inf
from typing import NamedTuple

from colibri.companion.stacks.stack import Stack
from colibri.companion.supervision.phases import CompanionPhase, PhaseCondition

WITHIN_S: dict[CompanionPhase, float] = {
    CompanionPhase.ARMING: 10.0,
    CompanionPhase.TAKING_OFF: 40.0,
    CompanionPhase.TAKING_OVER: 5.0,
    CompanionPhase.HANDING_OVER: 10.0,
}
"""Timeout of each phase."""


class Situation(NamedTuple):
    """Inputs of the conditions; `modes` are of the companion's making, `mode` is -1 before the first report."""

    phase: CompanionPhase
    stack: Stack | None
    in_phase_s: float
    gives_up_s: float
    mode: int
    modes: frozenset[int]
    failing: int
    connected: bool
    armed: bool
    airborne: bool | None
    may_arm: bool
    held: bool
    is_up: bool
    finished: bool
    must_end: bool
    stopped: bool


def conditions(now: Situation) -> frozenset[PhaseCondition]:
    within_s = inf if now.phase is CompanionPhase.FLYING else WITHIN_S.get(now.phase, now.gives_up_s)
    found = {
        PhaseCondition.STOPPED: now.stopped,
        PhaseCondition.MUST_END: now.must_end,
        PhaseCondition.CONNECTED: now.connected,
        PhaseCondition.FINISHED: now.finished,
        PhaseCondition.TOO_LATE: now.in_phase_s > within_s,
    }
    if now.stack is not None:
        offboard, checked = now.mode == now.stack.offboard.custom, now.failing == 0
        flies = now.armed and now.airborne is not False
        found |= {
            PhaseCondition.OFFBOARD: offboard,
            PhaseCondition.HELD: now.held,
            PhaseCondition.PILOT: now.mode not in now.modes,
            PhaseCondition.ARMED: now.armed,
            PhaseCondition.DISARMED: not now.armed,
            PhaseCondition.UP: now.is_up,
            PhaseCondition.CHECKED_IN_AIR: checked and flies and (offboard or now.mode in now.stack.steady),
            PhaseCondition.CHECKED_TO_ARM: checked and not flies and now.may_arm and now.airborne is not True,
        }
    return frozenset(condition for condition, holds in found.items() if holds)
