"""Gather the conditions of the phase table from one situation."""

from math import inf
from typing import NamedTuple

from colibri.companion.stacks.stack import Stack
from colibri.companion.supervision.phases import Condition, Phase

WITHIN_S: dict[Phase, float] = {
    Phase.ARMING: 10.0,
    Phase.TAKING_OFF: 40.0,
    Phase.TAKING_OVER: 5.0,
    Phase.HANDING_OVER: 10.0,
}
"""Timeout of each phase."""


class Situation(NamedTuple):
    """Inputs of the conditions; `modes` are of the companion's making, `mode` is -1 before the first report."""

    phase: Phase
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


def conditions(now: Situation) -> frozenset[Condition]:
    within_s = inf if now.phase is Phase.FLYING else WITHIN_S.get(now.phase, now.gives_up_s)
    found = {
        Condition.STOPPED: now.stopped,
        Condition.MUST_END: now.must_end,
        Condition.CONNECTED: now.connected,
        Condition.FINISHED: now.finished,
        Condition.TOO_LATE: now.in_phase_s > within_s,
    }
    if now.stack is not None:
        offboard, checked = now.mode == now.stack.offboard.custom, now.failing == 0
        flies = now.armed and now.airborne is not False
        found |= {
            Condition.OFFBOARD: offboard,
            Condition.HELD: now.held,
            Condition.PILOT: now.mode not in now.modes,
            Condition.ARMED: now.armed,
            Condition.DISARMED: not now.armed,
            Condition.UP: now.is_up,
            Condition.CHECKED_IN_AIR: checked and flies and (offboard or now.mode in now.stack.steady),
            Condition.CHECKED_TO_ARM: checked and not flies and now.may_arm and now.airborne is not True,
        }
    return frozenset(condition for condition, holds in found.items() if holds)
