"""MAVLink 2 message signing: https://mavlink.io/en/guide/message_signing.html."""

from collections.abc import Callable
from hashlib import sha256
from hmac import compare_digest
from pathlib import Path

from colibri.common.files import read_with_mode
from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.wire.dialect import MARKER, SIGNATURE_BYTES, SIGNED

KEY_BYTES = 32
TICK_US = 10  # unit of timestamps, since `EPOCH_S`
EPOCH_S = 1_420_070_400  # 1 January 2015, Unix time
LAST_TICK = (1 << 48) - 1
NEW_STREAM_TICKS = 6_000_000  # one minute: greatest lag of a new stream behind the own timestamp
AHEAD_TICKS = 3_000_000  # half a minute: greatest lead; less, so that no accepted stamp keeps out a right clock
TOO_EARLY = "signed in the future"
STREAMS = 1024

_TIMESTAMP_BYTES = 6
_DIGEST_BYTES = 6
_FLAGS_AT, _SYSTEM_AT, _COMPONENT_AT = 2, 5, 6
_NO_KEY = bytes(KEY_BYTES)
_NEVER_SIGNED = frozenset({"RADIO_STATUS"})  # sent by radios without a key: "always accepted without signing"


class SigningError(MavlinkError):
    """An invalid key; the message is for the user."""


def parse_key(content: bytes) -> bytes:
    """Return the key of a key file: 32 bytes, or 64 hexadecimal digits."""
    if len(content) == KEY_BYTES:
        key = content
    else:
        try:
            key = bytes.fromhex(content.decode("ascii"))
        except ValueError:
            key = b""
        if len(key) != KEY_BYTES:
            raise SigningError(f"expected 32 bytes or 64 hexadecimal digits, found {len(content)} bytes")
    if key == _NO_KEY:
        raise SigningError("the key is all zeros")
    return key


def read_key(path: Path) -> tuple[bytes, str]:
    """Return the key of a file, and a warning if others can read it; one that others can write is refused."""
    content, mode = read_with_mode(path)
    if mode & 0o002:
        raise SigningError(f"writable by everyone (mode {mode:04o}): make a new key, and chmod 600 the file")
    return parse_key(content), f"mode {mode:04o} lets others use the key: chmod 600" if mode & 0o077 else ""


def tick_at(unix_s: float) -> int:
    return min(int((unix_s - EPOCH_S) * 1e6 / TICK_US), LAST_TICK) if unix_s > EPOCH_S else 0


class Signing:
    """Verifies and signs frames; without a key, accepts all and signs none. Its timestamp never decreases."""

    def __init__(self, key: bytes | None, clock: Callable[[], int], stored: int = 0) -> None:
        """Begin at the later of `clock` and `stored`, in ticks."""
        self._key = _NO_KEY if key is None else key
        self._clock = clock
        self._streams: dict[tuple[int, int, int], int] = {}
        self._forgotten = -1
        self.timestamp = min(max(stored, clock()), LAST_TICK)  # ticks; to be stored for the next start
        self.key_changed = False  # by SETUP_SIGNING; the owner may reset this

    @property
    def active(self) -> bool:
        return self._key != _NO_KEY

    @property
    def key(self) -> bytes | None:
        return self._key if self.active else None

    def sign(self, frame: bytes, link_id: int) -> bytes:
        """Return the signature of `frame`, which already has the flag."""
        now = self._clock()
        if now > self.timestamp:
            self.timestamp = now
        elif self.timestamp < LAST_TICK:
            self.timestamp += 1
        head = bytes([link_id & 0xFF]) + self.timestamp.to_bytes(_TIMESTAMP_BYTES, "little")
        return head + self._digest(frame + head)

    def refusal(self, name: str, frame: bytes) -> str | None:
        if not self.active:
            return None
        if frame[0] != MARKER or not frame[_FLAGS_AT] & SIGNED:
            return None if name in _NEVER_SIGNED else "unsigned"
        if not compare_digest(self._digest(frame[:-_DIGEST_BYTES]), frame[-_DIGEST_BYTES:]):
            return "bad signature"
        timestamp = int.from_bytes(frame[-_DIGEST_BYTES - _TIMESTAMP_BYTES : -_DIGEST_BYTES], "little")
        stream = (frame[_SYSTEM_AT], frame[_COMPONENT_AT], frame[-SIGNATURE_BYTES])
        now = self._clock()
        if timestamp > now + AHEAD_TICKS:
            return TOO_EARLY
        self.timestamp = max(self.timestamp, now)
        if timestamp <= self._streams.get(stream, self._oldest_of_a_new_stream(now) - 1):
            return "replayed"
        self._remember(stream, timestamp)
        self.timestamp = max(self.timestamp, timestamp)
        return None

    def set_up(self, key: bytes, initial_timestamp: int) -> bool:
        """Apply SETUP_SIGNING (zeros turn signing off); return whether its values are valid."""
        now = self._clock()
        if len(key) != KEY_BYTES or not 0 <= initial_timestamp <= now + AHEAD_TICKS:
            return False
        self.key_changed |= key != self._key
        self._key = key  # streams are kept: an old key may come back, and what it signed must not
        self.timestamp = max(self.timestamp, now, initial_timestamp)
        return True

    def _oldest_of_a_new_stream(self, now: int) -> int:
        """Return the oldest timestamp of a new stream; one stored from the future is not waited for."""
        return max(min(self.timestamp, now + AHEAD_TICKS) - NEW_STREAM_TICKS, self._forgotten + 1)

    def _remember(self, stream: tuple[int, int, int], timestamp: int) -> None:
        """Store a stream's last timestamp; of too many, forget the oldest and reject as old ones."""
        self._streams[stream] = timestamp
        if len(self._streams) > STREAMS:
            oldest = min(self._streams, key=self._streams.__getitem__)
            self._forgotten = max(self._forgotten, self._streams.pop(oldest))

    def _digest(self, data: bytes) -> bytes:
        return sha256(self._key + data).digest()[:_DIGEST_BYTES]
