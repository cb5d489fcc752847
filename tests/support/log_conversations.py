"""Logs of a vehicle, listed and downloaded: messages LOG_REQUEST_LIST to LOG_REQUEST_END of common.xml."""

from collections.abc import Sequence

from colibri.mavlink.client.conversation import OK, Conversation, Encoded, Repeat, Target
from colibri.mavlink.wire.dialect import Message

_BLOCK_BYTES = 90
_CHUNK_BYTES = 128 * _BLOCK_BYTES  # as much as a socket's buffer surely holds, and as MAVSDK requests at once
_SILENCE = Repeat(every_us=100_000, tries=100)  # what is missing of an answer is requested again after a short silence
_LAST_ID = 0xFFFF


class ListLogs(Conversation):
    """The logs that a vehicle has.

    Attributes:
        sizes: Of each log by its id, bytes.
    """

    answers = frozenset({"LOG_ENTRY"})

    def __init__(self, target: Target, *, repeat: Repeat = _SILENCE) -> None:
        super().__init__(target, "logs", repeat)
        self.sizes: dict[int, int] = {}

    def _read(self, message: Message) -> None:
        fields = message.fields
        if fields.num_logs:
            self.sizes[fields.id] = fields.size
        if len(self.sizes) >= fields.num_logs:
            self.result = OK
        self._wait(self._repeat.every_us)

    def _request(self) -> Sequence[Encoded]:
        return (("LOG_REQUEST_LIST", (*self.target, 0, _LAST_ID)),)


class DownloadLog(Conversation):
    """One log, chunk by chunk; what was lost of a chunk is requested again."""

    answers = frozenset({"LOG_DATA"})

    def __init__(self, target: Target, log: int, size: int, *, repeat: Repeat = _SILENCE) -> None:
        super().__init__(target, "logs", repeat)
        self._log = log
        self._data = bytearray(size)
        self._end = 0
        self._missing: set[int] = set()

    @property
    def data(self) -> bytes:
        """The log; zeros where it has not come yet."""
        return bytes(self._data)

    def _read(self, message: Message) -> None:
        fields = message.fields
        if fields.id != self._log or fields.ofs not in self._missing:
            return
        self._missing.remove(fields.ofs)
        self._data[fields.ofs : fields.ofs + fields.count] = bytes(fields.data[: fields.count])
        if self._missing:
            self._wait(self._repeat.every_us)
        else:
            self._go_on()

    def _request(self) -> Sequence[Encoded]:
        if not self._missing:
            begin, self._end = self._end, min(self._end + _CHUNK_BYTES, len(self._data))
            self._missing = set(range(begin, self._end, _BLOCK_BYTES))
        if not self._missing:
            self.result = OK
            return (("LOG_REQUEST_END", self.target),)
        first = min(self._missing)
        return (("LOG_REQUEST_DATA", (*self.target, self._log, first, self._end - first)),)
