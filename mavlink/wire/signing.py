"""Message signing of MAVLink 2: which frames to accept, how to sign our own.

Specification: https://mavlink.io/en/guide/message_signing.html. All components of a network share one key. A signature
is 13 bytes behind the frame: link id, timestamp, and the first 48 bits of a SHA-256 over key and all that went before.
"""

from hashlib import sha256
from hmac import compare_digest

from colibri.mavlink.errors import MavlinkError
from colibri.mavlink.wire.dialect import MARKER, SIGNATURE_BYTES, SIGNED

KEY_BYTES = 32
TICK_US = 10
"""What timestamps count, since `EPOCH_S`."""
EPOCH_S = 1_420_070_400
"""1 January 2015 in seconds of Unix time."""
LAST_TICK = (1 << 48) - 1
NEW_STREAM_TICKS = 6_000_000
"""By how much, one minute, the first frame of a stream may be behind our own timestamp."""
STREAMS = 1024

_TIMESTAMP_BYTES = 6
_DIGEST_BYTES = 6
_FLAGS_AT, _SYSTEM_AT, _COMPONENT_AT = 2, 5, 6
_NO_KEY = bytes(KEY_BYTES)
_NEVER_SIGNED = frozenset({"RADIO_STATUS"})
"""Radios put these in by themselves and have no key: "always accepted without signing"."""


class SigningError(MavlinkError):
    """A key that is none; the message is what a user needs."""


def parse_key(content: bytes) -> bytes:
    """Return the key in a key file: 32 bytes, or 64 hexadecimal digits with white space around them.

    Raises:
        SigningError: It is neither, or all zeros, which means no signing at all.
    """
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
        raise SigningError("a key of zeros signs nothing")
    return key


def tick_at(unix_s: float) -> int:
    """Return the timestamp of a wall-clock time, for the start."""
    return min(max(round((unix_s - EPOCH_S) * 1e6 / TICK_US), 0), LAST_TICK)


class Signing:
    """Judges and signs frames; without a key it accepts all and signs nothing.

    Our own timestamp advances with the simulated time, with every frame signed and with every later one accepted, and
    never goes back.

    Attributes:
        timestamp: Our own, ticks since 2015: to be stored now and then, and handed in at the next start.
        key_changed: Whether SETUP_SIGNING has changed the key; the owner may store it and reset this.
    """

    def __init__(self, key: bytes | None, start: int, now_us: int = 0) -> None:
        """Begin with a `key`, at timestamp `start`: the later one of the wall clock's and the one stored last."""
        self._key = _NO_KEY if key is None else key
        start = min(max(start, 0), LAST_TICK)
        self._start = start - now_us // TICK_US
        self._streams: dict[tuple[int, int, int], int] = {}
        self._forgotten = -1
        self.timestamp = start
        self.key_changed = False

    @property
    def active(self) -> bool:
        """Whether there is a key."""
        return self._key != _NO_KEY

    @property
    def key(self) -> bytes | None:
        """The key; None if there is none."""
        return self._key if self.active else None

    def sign(self, frame: bytes, link_id: int, now_us: int) -> bytes:
        """Return the signature of `frame`, which is whole but for that, its flag set."""
        self._advance(now_us)
        self.timestamp = min(self.timestamp + 1, LAST_TICK)
        head = bytes([link_id & 0xFF]) + self.timestamp.to_bytes(_TIMESTAMP_BYTES, "little")
        return head + self._digest(frame + head)

    def refusal(self, name: str, frame: bytes, now_us: int) -> str | None:
        """Return why message `name` in `frame` is not accepted; None if it is."""
        if not self.active:
            return None
        if frame[0] != MARKER or not frame[_FLAGS_AT] & SIGNED:
            return None if name in _NEVER_SIGNED else "unsigned"
        self._advance(now_us)
        if not compare_digest(self._digest(frame[:-_DIGEST_BYTES]), frame[-_DIGEST_BYTES:]):
            return "bad signature"
        timestamp = int.from_bytes(frame[-_DIGEST_BYTES - _TIMESTAMP_BYTES : -_DIGEST_BYTES], "little")
        stream = (frame[_SYSTEM_AT], frame[_COMPONENT_AT], frame[-SIGNATURE_BYTES])
        if timestamp <= self._streams.get(stream, self._oldest_of_a_new_stream() - 1):
            return "replayed"
        self._remember(stream, timestamp)
        self.timestamp = max(self.timestamp, timestamp)
        return None

    def set_up(self, key: bytes, initial_timestamp: int, now_us: int) -> bool:
        """Obey SETUP_SIGNING, which the caller must have accepted: zeros switch signing off.

        Returns:
            Whether key and timestamp were such as can be.
        """
        if len(key) != KEY_BYTES or not 0 <= initial_timestamp < LAST_TICK:
            return False
        self._advance(now_us)
        self.key_changed |= key != self._key
        self._key = key  # streams are kept: an old key may come back, and what it signed must not
        self.timestamp = max(self.timestamp, initial_timestamp)
        return True

    def _advance(self, now_us: int) -> None:
        self.timestamp = min(max(self.timestamp, self._start + now_us // TICK_US), LAST_TICK)

    def _oldest_of_a_new_stream(self) -> int:
        return max(self.timestamp - NEW_STREAM_TICKS, self._forgotten + 1)

    def _remember(self, stream: tuple[int, int, int], timestamp: int) -> None:
        """Keep when a stream was received last; of too many forget the oldest, and accept no new one that is so old."""
        self._streams[stream] = timestamp
        if len(self._streams) > STREAMS:
            oldest = min(self._streams, key=self._streams.__getitem__)
            self._forgotten = max(self._forgotten, self._streams.pop(oldest))

    def _digest(self, data: bytes) -> bytes:
        return sha256(self._key + data).digest()[:_DIGEST_BYTES]
