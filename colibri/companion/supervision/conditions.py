"""Gather the conditions of the phase table from one situation."""

from collections.abc import Iterator
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
    return frozenset(_holding(now))


def _holding(now: Situation) -> Iterator[Condition]:
    if now.stopped:
        yield Condition.STOPPED
    if now.must_end:
        yield Condition.MUST_END
    if now.connected:
        yield Condition.CONNECTED
    if now.finished:
        yield Condition.FINISHED
    if now.in_phase_s > WITHIN_S.get(now.phase, now.gives_up_s) and now.phase is not Phase.FLYING:
        yield Condition.TOO_LATE
    if now.stack is None:
        return
    yield from _of_the_mode(now, now.stack)
    if now.armed:
        yield Condition.ARMED
    else:
        yield Condition.DISARMED
    if now.is_up:
        yield Condition.UP
    if now.failing == 0 and now.armed and now.airborne is not False:
        if now.mode in now.stack.steady or now.mode == now.stack.offboard.custom:
            yield Condition.CHECKED_IN_AIR
    elif now.failing == 0 and now.may_arm and now.airborne is not True:
        yield Condition.CHECKED_TO_ARM


def _of_the_mode(now: Situation, stack: Stack) -> Iterator[Condition]:
    if now.mode == stack.offboard.custom:
        yield Condition.OFFBOARD
    if now.held:
        yield Condition.HELD
    if now.mode not in now.modes:
        yield Condition.PILOT
