"""A serial port as a non-blocking endpoint, reopened when its device returns; pyserial only opens it."""

import errno
import os
import select
from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING

from colibri.common.types import Address
from colibri.mavlink.links.link import Endpoint, LinkError
from colibri.mavlink.wire.framing import Framer

if TYPE_CHECKING:
    from serial import Serial

REOPEN_AFTER_S = 1.0
QUEUE_S = 0.1  # send queue, in time on the line: older telemetry is useless
MIN_QUEUE_BYTES = 1024  # three of the longest frames
_BITS_PER_BYTE = 10
_CHUNK_BYTES = 4096
_CHUNKS_AT_ONCE = 16  # limit per call, so that a continuous sender cannot stall the process
_REASONS = {
    errno.ENOENT: "no such device: plug it in, or choose another",
    errno.EACCES: "no permission; join the group that owns it (often dialout), and log in again",
    errno.EAGAIN: "another program has it; end that, or name another",
    errno.EBUSY: "another program has it; end that, or name another",
    errno.ENOTTY: "not a serial port: choose another",
}


class SerialLink(Endpoint):
    target: Address

    def __init__(self, url: str, device: str, baud: int, clock: Callable[[], float] = perf_counter) -> None:
        super().__init__(url, (device, baud))
        self._clock = clock
        self._queue_bytes = max(MIN_QUEUE_BYTES, round(QUEUE_S * baud / _BITS_PER_BYTE))
        self._open_again_s = 0.0
        self._begin(_opened(url, device, baud))

    def send(self, datagram: bytes, address: Address | None = None) -> None:
        if not self._is_open() or address not in (None, self.target):
            return
        if len(self._pending) + len(datagram) > self._queue_bytes:
            self._flush()
        if len(self._pending) + len(datagram) <= self._queue_bytes:
            self._pending += datagram
            self._flush()

    def receive_now(self) -> list[tuple[bytes, Address]]:
        received: list[tuple[bytes, Address]] = []
        if self._is_open():
            self._flush()
        for _ in range(_CHUNKS_AT_ONCE):
            chunk = self._read()
            if not chunk:
                break
            received += [(frame, self.target) for frame in self._framer.take(chunk)]
        return received

    def wait(self, timeout_s: float) -> None:
        if self._port is None:
            select.select([], [], [], max(0.0, min(timeout_s, self._open_again_s - self._clock())))
        else:
            select.select([self._port], [], [], timeout_s)

    def close(self) -> None:
        self._release()
        self._open_again_s = float("inf")

    def _begin(self, port: "Serial") -> None:
        self._port: Serial | None = port
        self._framer, self._pending = Framer(), bytearray()
        if self._closed:  # nobody has noticed: it goes on
            self._closed.clear()
        else:
            self._opened.append(self.target)

    def _is_open(self) -> bool:
        if self._port is None and self._clock() >= self._open_again_s:
            try:
                self._begin(_opened(self.url, *self.target))
            except LinkError:
                self._open_again_s = self._clock() + REOPEN_AFTER_S
            else:
                self._notes.append(f"{self.url}: the device is back")
        return self._port is not None

    def _read(self) -> bytes:
        """Return a chunk of input; `in_waiting` fails if the device has gone."""
        if self._port is None:
            return b""
        try:
            return os.read(self._port.fileno(), _CHUNK_BYTES) if self._port.in_waiting else b""
        except BlockingIOError:
            return b""
        except OSError as error:
            self._lose(error)
            return b""

    def _flush(self) -> None:
        try:
            while self._pending and self._port is not None:
                del self._pending[: os.write(self._port.fileno(), self._pending)]
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(error)

    def _lose(self, error: OSError) -> None:
        self._release()
        self._open_again_s = self._clock() + REOPEN_AFTER_S
        self._closed.append(self.target)
        self._notes.append(f"{self.url}: the device is gone ({error.strerror}); it is opened again when it is back")

    def _release(self) -> None:
        if self._port is not None:
            self._port.close()
        self._port = None


def _opened(url: str, device: str, baud: int) -> "Serial":
    if os.name != "posix":
        raise LinkError(f"{url}: serial ports are for Linux and macOS; use udpin: or tcp: here")
    try:
        from serial import Serial
    except ImportError as error:
        raise LinkError(f"{url}: pyserial is not installed: pip install colibri-sitl[serial]") from error
    try:
        return Serial(device, baud, timeout=0, write_timeout=0, exclusive=True)
    except (OSError, ValueError, OverflowError) as error:
        raise LinkError(f"{url}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    if not isinstance(error, OSError):
        return "unsupported baud rate: choose another"
    number = error.errno
    if number is None and error.__context__ is not None:  # termios has errors of its own, which pyserial only quotes
        number = error.__context__.args[0]
    return _REASONS.get(number, str(error)) if isinstance(number, int) else str(error)
