"""What both sides of a flight in lockstep share."""

from time import perf_counter, sleep
from typing import NamedTuple, TypeAlias

from colibri.mavlink.hil.conductor import StepMessage
from colibri.mavlink.hil.state import ActuatorCommand, StateFrame
from colibri.mavlink.wire.dialect import TRUTH_COMPONENT, mav
from colibri.sitl.errors import SitlError

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


__tracebackhide__ = True  # a failed test shows its own lines, not these

_HEADER_BYTES, _CRC_BYTES, _COMPONENT_AT = 10, 2, 6
_ANSWER = int(mav.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS).to_bytes(3, "little")


class SessionError(SitlError):
    """A flight cannot go on: a process has died or is silent."""


class Instant(NamedTuple):
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
        if datagram[at + 7 : at + _HEADER_BYTES] == _ANSWER and datagram[at + _HEADER_BYTES : at + 18] == sought:
            return True
        at += _HEADER_BYTES + datagram[at + 1] + _CRC_BYTES
    return False


def parted(datagram: bytes) -> tuple[bytes, bytes]:
    """Split a plant's datagram into the part for the autopilot and the truth behind it."""
    at = 0
    while at < len(datagram) and datagram[at + _COMPONENT_AT] != TRUTH_COMPONENT:
        at += _HEADER_BYTES + datagram[at + 1] + _CRC_BYTES
    return datagram[:at], datagram[at:]
