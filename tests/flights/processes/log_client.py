"""A client of log download, as ground stations have it, on a link that loses datagrams."""

import random
import socket
from time import monotonic
from types import TracebackType
from typing import Any, Self

from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, Codec

LOSS = 0.2
_BLOCK_BYTES = 90
_CHUNK_BLOCKS = 128
"""What MAVSDK asks for at once."""
_SILENCE_S = 0.1
"""After it what is missing is requested again."""
_GIVE_UP_AFTER_S = 60.0
_SYSTEM_ID = 245


class LogClient:
    """Lists and downloads logs; of what it sends and receives a part is lost.

    Attributes:
        lost: How many datagrams were.
    """

    def __init__(self, port: int, seed: int, target: int = 1) -> None:
        """Call the vehicle that waits on `port` of this computer."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.settimeout(_SILENCE_S)
        self._codec = Codec(_SYSTEM_ID, 190)
        self._vehicle = (target, AUTOPILOT_COMPONENT)
        self._chance = random.Random(seed)
        self.lost = 0

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the link."""
        self._socket.close()

    def sizes(self) -> list[int]:
        """Return the sizes of all logs, bytes."""
        found: dict[int, int] = {}
        count, until_s = 1, monotonic() + _GIVE_UP_AFTER_S
        while len(found) < count:
            assert monotonic() < until_s, found
            for entry in self._asked("LOG_REQUEST_LIST", 0, 0xFFFF, answer="LOG_ENTRY", answers=count):
                count, found[entry.id] = entry.num_logs, entry.size
        return [found[number] for number in range(count)]

    def download(self, number: int, size: int) -> bytes:
        """Return a log, chunk by chunk; what was lost of one is requested again."""
        log, until_s = bytearray(size), monotonic() + _GIVE_UP_AFTER_S
        blocks = range(0, size, _BLOCK_BYTES)
        for begin in range(0, len(blocks), _CHUNK_BLOCKS):
            missing = set(blocks[begin : begin + _CHUNK_BLOCKS])
            while missing:
                assert monotonic() < until_s, f"{len(missing)} blocks are missing"
                first, behind = min(missing), max(missing) + _BLOCK_BYTES
                wanted = (number, first, behind - first)
                for block in self._asked("LOG_REQUEST_DATA", *wanted, answer="LOG_DATA", answers=len(missing)):
                    if block.id == number and block.ofs in missing:
                        missing.remove(block.ofs)
                        log[block.ofs : block.ofs + block.count] = bytes(block.data[: block.count])
        return bytes(log)

    def _asked(self, name: str, *fields: Any, answer: str, answers: int) -> list[Any]:
        """Send a request; return the answers that came before it was silent."""
        if not self._loses():
            self._socket.send(self._codec.encode(name, *self._vehicle, *fields))
        found: list[Any] = []
        until_s = monotonic() + _SILENCE_S
        while len(found) < answers and monotonic() < until_s:
            try:
                datagram = self._socket.recv(4096)
            except TimeoutError:
                break
            if self._loses():
                continue
            came = [message.fields for message in self._codec.decode(datagram) if message.name == answer]
            if came:
                found += came
                until_s = monotonic() + _SILENCE_S
        return found

    def _loses(self) -> bool:
        lost = self._chance.random() < LOSS
        self.lost += lost
        return lost
