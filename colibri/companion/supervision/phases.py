"""Phases of a companion, a table whose first row that holds applies; consistency of states, and rate of setpoints."""

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from enum import StrEnum
from math import acos, dist
from typing import NamedTuple

from colibri.common.rotations import normalized, quaternion_product
from colibri.common.types import Quaternion, Vector
from colibri.companion.supervision.rules import FlightFacts, Rule
from colibri.companion.vehicle_peer import ReceivedState
from colibri.mavlink.hil.state import StateFrame


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


WINDOW_S = 0.15
MAX_GAP_S, MAX_JUMP_GAP_S = 0.1, 1.0  # states further apart are not compared, or not for jumps
MAX_TURN_RAD, MAX_WAY_M = 0.15, 0.15  # largest contradiction in a window: 1 rad/s, 1 m/s
_WINDOWS = 2  # a correction of the estimate contradicts once, stale values again and again


class Consistency:
    """Integrates body rates and velocity over windows; `jumped_m` is the largest jump until its reader clears it."""

    def __init__(self) -> None:
        self.contradiction, self.jumped_m = "", 0.0
        self._start: ReceivedState | None = None
        self._last: ReceivedState | None = None
        self._turned: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self._moved: Vector = (0.0, 0.0, 0.0)
        self._windows = 0

    def add(self, at_us: int, state: StateFrame) -> None:
        now, last = ReceivedState(at_us, state), self._last
        self._last = now
        passed_s = 0.0 if last is None else (at_us - last.at_us) * 1e-6
        if last is not None and passed_s < MAX_JUMP_GAP_S:
            there = _moved(last.state.position_enu_m, last.state.velocity_enu_m_s, passed_s)
            self.jumped_m = max(self.jumped_m, dist(there, state.position_enu_m))
        if last is None or self._start is None or not 0.0 < passed_s <= MAX_GAP_S:
            self._begin(now)
            self._windows, self.contradiction = 0, ""
            return
        p, q, r = _mean(last.state.rate_flu_rad_s, state.rate_flu_rad_s)
        self._turned = _turned(self._turned, (p * passed_s, q * passed_s, r * passed_s))
        velocity = _mean(last.state.velocity_enu_m_s, state.velocity_enu_m_s)
        self._moved = _moved(self._moved, velocity, passed_s)
        if (at_us - self._start.at_us) * 1e-6 >= WINDOW_S:
            self._judge(state)
            self._begin(now)

    def _begin(self, now: ReceivedState) -> None:
        self._start, self._turned, self._moved = now, now.state.attitude, now.state.position_enu_m

    def _judge(self, state: StateFrame) -> None:
        cosine = abs(sum(a * b for a, b in zip(self._turned, state.attitude, strict=True)))
        turn_rad, way_m = 2.0 * acos(min(cosine, 1.0)), dist(self._moved, state.position_enu_m)
        found = ""
        if turn_rad > MAX_TURN_RAD:
            found = "attitude and body rates"
        elif way_m > MAX_WAY_M:
            found = "position and velocity"
        self._windows = self._windows + 1 if found else 0
        self.contradiction = f"{found} contradict each other" if self._windows >= _WINDOWS else ""


def _moved(place: Vector, velocity: Vector, for_s: float) -> Vector:
    return (place[0] + velocity[0] * for_s, place[1] + velocity[1] * for_s, place[2] + velocity[2] * for_s)


def _mean(a: Vector, b: Vector) -> Vector:
    return (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))


def _turned(q: Quaternion, by_rad: Vector) -> Quaternion:
    p, q_, r = (0.5 * angle for angle in by_rad)
    return normalized(quaternion_product(q, (1.0, p, q_, r)))


_WINDOW_US = 1_000_000


class SetpointRate:
    """Counts setpoints against those due over the last second."""

    def __init__(self) -> None:
        self._began_us = 0
        self._sent_us: deque[int] = deque()

    def begin(self, now_us: int) -> None:
        self._began_us = now_us
        self._sent_us.clear()

    def count(self, now_us: int) -> None:
        self._sent_us.append(now_us)
        while self._sent_us[0] <= now_us - _WINDOW_US:
            self._sent_us.popleft()

    def gap_s(self, now_us: int) -> float:
        last_us = self._sent_us[-1] if self._sent_us else self._began_us
        return (now_us - last_us) * 1e-6

    def kept(self, now_us: int, interval_us: int) -> float:
        """Return the part of the last second's setpoints that was computed, 1 at first."""
        if now_us - self._began_us < _WINDOW_US:
            return 1.0
        there = len(self._sent_us) - bisect_right(self._sent_us, now_us - _WINDOW_US)
        return there * interval_us / _WINDOW_US
