"""Faults of a link, reproducible by seed and time, and what both sides of a flight in lockstep share."""

from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from random import Random
from time import perf_counter, sleep
from typing import TypeAlias

from colibri.common.errors import unknown
from colibri.common.records import Record
from colibri.mavlink.hil.conductor import StepMessage
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.wire.dialect import CRC_BYTES, HEADER_BYTES, TRUTH_COMPONENT, mav
from colibri.sitl.errors import SitlError

__tracebackhide__ = True  # a failed test shows its own lines, not these

_HELD_BACK_S = 0.05  # largest delay of a reordered datagram

_MAX = {"loss": 1.0, "delay_s": inf, "jitter_s": inf, "duplicate": 1.0, "reorder": 1.0, "corrupt": 1.0, "down": True}
"""Largest value of each fault; the smallest is 0."""


@dataclass(slots=True)
class Trouble:
    """The faults of a link, drawn for each datagram; may be changed at any time."""

    loss: float = 0.0  # fraction of datagrams lost
    delay_s: float = 0.0  # delay of each datagram
    jitter_s: float = 0.0  # largest additional delay
    duplicate: float = 0.0  # fraction delivered twice, the copy with its own delay
    reorder: float = 0.0  # fraction delayed so that later ones overtake
    corrupt: float = 0.0  # fraction with a wrong bit
    down: bool = False

    def __setattr__(self, name: str, value: float) -> None:
        if name not in _MAX:
            raise AttributeError(unknown("fault of a link", name, sorted(_MAX)))
        if not isinstance(value, int | float) or not 0.0 <= value <= _MAX[name] or value == inf:
            limits = "from 0 on, in s" if _MAX[name] == inf else f"from 0 to {_MAX[name]:g}"
            raise ValueError(f"{name} of a link must be {limits}, not {value!r}")
        object.__setattr__(self, name, value)

    @property
    def any(self) -> bool:
        of_chance = self.loss or self.duplicate or self.reorder or self.corrupt
        return bool(of_chance or self.delay_s or self.jitter_s or self.down)


class Pipe:
    """One direction of a link; the same `seed` affects the same datagrams."""

    def __init__(self, trouble: Trouble, seed: str) -> None:
        self._trouble = trouble
        self._chance = Random(seed)
        self._waiting: list[tuple[int, int, bytes]] = []
        self._order = 0

    def put(self, datagram: bytes, now_us: int) -> None:
        trouble, chance = self._trouble, self._chance
        if not trouble.any:
            self._wait(now_us, datagram)
            return
        lost, twice, held, spoiled, first, second, late, place = (chance.random() for _ in range(8))
        if trouble.down or lost < trouble.loss:
            return
        if spoiled < trouble.corrupt:
            datagram = spoilt(datagram, place)
        delay_s = trouble.delay_s + first * trouble.jitter_s + (late * _HELD_BACK_S if held < trouble.reorder else 0.0)
        self._wait(now_us + round(delay_s * 1e6), datagram)
        if twice < trouble.duplicate:
            self._wait(now_us + round((trouble.delay_s + second * trouble.jitter_s) * 1e6), datagram)

    def due(self, now_us: int) -> list[bytes]:
        arrived = []
        while self._waiting and self._waiting[0][0] <= now_us:
            arrived.append(heappop(self._waiting)[2])
        return [] if self._trouble.down else arrived

    @property
    def due_us(self) -> int | None:
        return self._waiting[0][0] if self._waiting else None

    def _wait(self, due_us: int, datagram: bytes) -> None:
        self._order += 1
        heappush(self._waiting, (due_us, self._order, datagram))


def spoilt(datagram: bytes, place: float) -> bytes:
    """Flip the bit at relative position `place`, 0..1."""
    if not datagram:
        return datagram
    bit = int(place * len(datagram) * 8)
    spoiled = bytearray(datagram)
    spoiled[bit // 8] ^= 1 << bit % 8
    return bytes(spoiled)


_QUICK = 10.0
_SOON_S = 2e-4


class StoppedClock:
    """Advances only while the plant waits: both sides are in this process."""

    def __init__(self) -> None:
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def wait(self, timeout_s: float) -> None:
        self._now_s += timeout_s


class QuickClock:
    """Ten times the wall clock, for an autopilot in another process: lost datagrams are repeated sooner."""

    def now_s(self) -> float:
        return _QUICK * perf_counter()

    def wait(self, timeout_s: float) -> None:
        sleep(min(timeout_s / _QUICK, _SOON_S))


LinkClock: TypeAlias = StoppedClock | QuickClock

_SYSTEM_AT, _COMPONENT_AT, _MESSAGE_AT = 5, 6, 7  # bytes of a MAVLink 2 header
_STATE = int(mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION).to_bytes(3, "little")  # what a frame of state begins with
_ANSWER = int(mav.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS).to_bytes(3, "little")


class SessionError(SitlError):
    """A flight cannot go on: a process has died or is silent."""


class Instant(Record, frozen=True):
    """A frame that was flown; `began` is the true state at its start."""

    began: StateFrame
    command: ActuatorCommand
    to_stations: StepMessage
    frame: bytes
    answer: bytes


def answers(datagram: bytes, time_us: int) -> bool:
    """Whether a datagram of unsigned MAVLink 2 frames answers the frame of a time."""
    sought = time_us.to_bytes(8, "little")
    at = 0
    while at < len(datagram):
        begins = at + HEADER_BYTES
        if datagram[at + _MESSAGE_AT : begins] == _ANSWER and datagram[begins : begins + len(sought)] == sought:
            return True
        at = _next(datagram, at)
    return False


def parted(datagram: bytes) -> tuple[bytes, bytes]:
    """Return the part of a plant's datagram for the autopilot, and the true state: behind it, or the frame's own."""
    if datagram[_MESSAGE_AT:HEADER_BYTES] == _STATE:
        return datagram, datagram[: _next(datagram, _next(datagram, 0))]
    at = 0
    while at < len(datagram) and datagram[at + _COMPONENT_AT] != TRUTH_COMPONENT:
        at = _next(datagram, at)
    return datagram[:at], datagram[at:]


def source_of(message: bytes) -> bytes:
    return message[_SYSTEM_AT:_MESSAGE_AT]


def _next(datagram: bytes, at: int) -> int:
    """Return where the message after that at byte `at` begins."""
    return at + HEADER_BYTES + datagram[at + 1] + CRC_BYTES
