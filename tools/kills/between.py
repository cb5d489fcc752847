"""A relay between plant and autopilots that acts at chosen simulated instants."""

import random
import socket
from collections.abc import Callable
from enum import Enum
from select import select
from time import monotonic

from colibri.mavlink.wire import dialect
from tools.harness.ports import bound_socket
from tools.kills.station import KillStation

GIVE_UP_AFTER_S, COMPILES_S = 60.0, 900.0
"""By the clock: bounds for what hangs, never a part of a verdict; the first autopilot may have to compile."""
_MAX_DATAGRAM_BYTES = 65536
_LOOK_S = 0.02
_HEAD = 10
"""Bytes of a frame of MAVLink 2 before its payload."""
_TIMES = {dialect.MSG_ATTITUDE_QUATERNION: (4, 1000), dialect.MSG_HIL_SENSOR: (8, 1)}
"""What a frame of the plant begins with: the bytes of its time, and the unit in µs."""
_ANSWER = 93
"""HIL_ACTUATOR_CONTROLS."""


class KillInstant(Enum):
    """Instant of a kill within the exchange of a frame."""

    BEFORE = "before the frame comes"
    DURING = "while the answer is computed"
    AFTER = "when the answer is sent"
    LOST = "when the answer is sent, which is lost"


class HangsError(Exception):
    """A wait timed out."""


class Between:
    """Relays between a plant and the autopilots that call it in turn, each over a separate way."""

    def __init__(self, plant: tuple[str, int]) -> None:
        self._plant = plant
        self.time_us = 0
        self._due: tuple[int, KillInstant, Callable[[], None]] | None = None
        self._chance = random.Random(0)
        self._open()

    def at(self, time_us: int, phase: KillInstant, do: Callable[[], None]) -> None:
        """Do something once, with the first frame from `time_us` on."""
        self._due = (time_us, phase, do)

    @property
    def waits(self) -> bool:
        return self._due is not None

    def cut(self) -> None:
        """Drop the autopilot, and wait for the next."""
        self.close()
        self._open()

    def fly_until(
        self, station: KillStation, condition: Callable[[], bool], what: str, give_up_after_s: float = GIVE_UP_AFTER_S
    ) -> None:
        """Relay, and serve the ground station, until `condition()`; raise `HangsError` after a bound."""
        give_up_s = monotonic() + give_up_after_s
        while not condition():
            ready, _, _ = select([self._near, self._far, station.socket], [], [], _LOOK_S)
            for sock in (self._near, self._far):
                if sock in ready and sock.fileno() >= 0:
                    self._pass_on(sock)
            if station.socket in ready:
                station.receive()
            if monotonic() > give_up_s:
                said = f"{station.mode}, item {station.seq}, {station.texts[-3:]}"
                raise HangsError(f"waited in vain for {what} at t = {self.time_us * 1e-6:.3f} s: {said}")

    def close(self) -> None:
        self._near.close()
        self._far.close()

    def _open(self) -> None:
        self._near, self.url = bound_socket()
        self._far, _ = bound_socket()
        for sock in (self._near, self._far):
            sock.setblocking(False)
        self._autopilot: tuple[str, int] | None = None

    def _pass_on(self, sock: socket.socket) -> None:
        while sock.fileno() >= 0:
            try:
                datagram, sender = sock.recvfrom(_MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                continue
            if sock is self._near:
                self._autopilot = sender
                self._from_autopilot(datagram)
            else:
                self._from_plant(datagram)

    def _from_plant(self, datagram: bytes) -> None:
        count, unit_us = _TIMES.get(_number(datagram), (0, 0))
        if count:
            payload = datagram[_HEAD : _HEAD + min(count, datagram[1])]  # zeros at a payload's end are left out
            self.time_us = int.from_bytes(payload, "little") * unit_us
        if self._is_due(KillInstant.BEFORE):
            return
        if self._autopilot:
            self._send(self._near, datagram, self._autopilot)
        self._is_due(KillInstant.DURING)

    def _from_autopilot(self, datagram: bytes) -> None:
        is_answer = _number(datagram) == _ANSWER
        far = self._far
        if is_answer and self._is_due(KillInstant.LOST):
            return
        if far.fileno() >= 0:
            self._send(far, datagram, self._plant)
        if is_answer:
            self._is_due(KillInstant.AFTER)

    def _is_due(self, phase: KillInstant) -> bool:
        """Do the planned action if it is due in this phase; return whether it was."""
        if self._due is None or self._due[1] is not phase or self.time_us < self._due[0]:
            return False
        (_, _, do), self._due = self._due, None
        do()
        return True

    def _send(self, sock: socket.socket, datagram: bytes, address: tuple[str, int]) -> None:
        try:
            sock.sendto(datagram, address)
        except ConnectionRefusedError:
            return


def _number(datagram: bytes) -> int:
    return int.from_bytes(datagram[7:_HEAD], "little")
