"""Step messages: all datagrams of stepped ground stations and a vehicle at one time, with the frame or its answer."""

from collections.abc import Sequence
from struct import Struct
from typing import NamedTuple

from colibri.common.records import Record

_HEAD = Struct("<QIBH")  # simulated time in µs, custom mode, whether armed, number of parcels
_PARCEL = Struct("<HH")  # station, length
_PIECE = Struct("<QBB")  # simulated time in µs, number of the piece, their count
_PIECE_BYTES = 4000  # of a link's largest datagram
MAX_PARCEL_BYTES = 4096  # longer datagrams are cut, as by a link


class Parcel(NamedTuple):
    """A datagram from or to a numbered ground station."""

    station: int
    datagram: bytes


class StepMessage(Record, frozen=True):
    """All datagrams of one time in one direction; mode and arming from the vehicle."""

    time_us: int
    parcels: Sequence[Parcel]
    custom_mode: int = 0  # as in HEARTBEAT
    armed: bool = False


def packets(step_message: StepMessage) -> list[bytes]:
    """Return a step message as at most 255 packets; raise `ValueError` if it needs more."""
    time_us, parcels = step_message.time_us, step_message.parcels
    content = _HEAD.pack(time_us, step_message.custom_mode, step_message.armed, len(parcels))
    for station, whole in parcels:
        datagram = whole[:MAX_PARCEL_BYTES]
        content += _PARCEL.pack(station, len(datagram)) + datagram
    pieces = [content[at : at + _PIECE_BYTES] for at in range(0, len(content), _PIECE_BYTES)]
    if len(pieces) > 255:
        raise ValueError(f"{len(content)} bytes are too many for one step message")
    return [_PIECE.pack(time_us, number, len(pieces)) + piece for number, piece in enumerate(pieces)]


class Gathering:
    """Reassembly of step messages from packets in any order."""

    def __init__(self) -> None:
        self._time_us = -1
        self._pieces: dict[int, bytes] = {}

    def take(self, packet: bytes) -> StepMessage | None:
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
