"""The conditions by which the phases follow each other, gathered from what is known at one instant."""

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
"""How long a phase may take."""


class Situation(NamedTuple):
    """What the conditions depend on.

    Attributes:
        in_phase_s: How long this phase has lasted.
        gives_up_s: How long to wait for the vehicle and its checks.
        mode: `custom_mode` that the vehicle reports; -1 before it does.
        modes: Those that are this companion's own doing, in this phase.
        failing: How many checks fail.
        airborne: None where the vehicle does not say.
        held: Whether the vehicle has taken the order to hold, and reports that it does.
    """

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
    """Return the conditions that hold."""
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
    """Yield what the reported mode says: a pilot's choice is any that is not this companion's doing."""
    if now.mode == stack.offboard.custom:
        yield Condition.OFFBOARD
    if now.held:
        yield Condition.HELD
    if now.mode not in now.modes:
        yield Condition.PILOT
