"""Step messages: what stepped ground stations and a vehicle send each other at one time, as packets between processes.

The process that steps simulated time sends, with each frame of the plant, all that ground stations send at that time;
the vehicle answers with all that it sends. So every datagram arrives at a definite frame, however slow either process
is.
"""

from collections.abc import Sequence
from struct import Struct
from typing import NamedTuple

_HEAD = Struct("<QIBH")
"""Simulated time in µs, custom mode, whether armed, number of parcels."""
_PARCEL = Struct("<HH")
"""Station, length."""
_PIECE = Struct("<QBB")
"""Simulated time in µs, number of the piece, how many there are."""
_PIECE_BYTES = 4000
"""Of a link's largest datagram."""
MAX_PARCEL_BYTES = 4096
"""A longer datagram is cut, as a link cuts it."""


class Parcel(NamedTuple):
    """A datagram on its way from or to the ground station of that number."""

    station: int
    datagram: bytes


class StepMessage(NamedTuple):
    """All datagrams of one time in one direction.

    Attributes:
        custom_mode: The mode that the vehicle is in, as its HEARTBEAT has it; 0 from ground stations.
        armed: Whether its rotors may turn; False from ground stations.
    """

    time_us: int
    parcels: Sequence[Parcel]
    custom_mode: int = 0
    armed: bool = False


def packets(step_message: StepMessage) -> list[bytes]:
    """Return a step message as packets, each of which fits a datagram.

    Raises:
        ValueError: It is more than 255 packets.
    """
    time_us, parcels, custom_mode, armed = step_message
    content = _HEAD.pack(time_us, custom_mode, armed, len(parcels))
    for station, whole in parcels:
        datagram = whole[:MAX_PARCEL_BYTES]
        content += _PARCEL.pack(station, len(datagram)) + datagram
    pieces = [content[at : at + _PIECE_BYTES] for at in range(0, len(content), _PIECE_BYTES)]
    if len(pieces) > 255:
        raise ValueError(f"{len(content)} bytes are too many for one step message")
    return [_PIECE.pack(time_us, number, len(pieces)) + piece for number, piece in enumerate(pieces)]


class Gathering:
    """Puts the packets of one step message together, in any order."""

    def __init__(self) -> None:
        """Begin with none."""
        self._time_us = -1
        self._pieces: dict[int, bytes] = {}

    def take(self, packet: bytes) -> StepMessage | None:
        """Take in a packet from the other process; return the step message if that completes it."""
        time_us, number, count = _PIECE.unpack_from(packet)
        if count == 1:
            return _step_message(packet, _PIECE.size)
        if time_us != self._time_us:
            self._time_us, self._pieces = time_us, {}
        self._pieces[number] = packet[_PIECE.size :]
        if len(self._pieces) < count:
            return None
        content = b"".join(self._pieces[number] for number in range(count))
        self._pieces = {}
        return _step_message(content)


def _step_message(content: bytes, at: int = 0) -> StepMessage:
    time_us, custom_mode, armed, count = _HEAD.unpack_from(content, at)
    at += _HEAD.size
    parcels = []
    for _ in range(count):
        station, length = _PARCEL.unpack_from(content, at)
        at += _PARCEL.size
        parcels.append(Parcel(station, content[at : at + length]))
        at += length
    return StepMessage(time_us, parcels, custom_mode, bool(armed))
