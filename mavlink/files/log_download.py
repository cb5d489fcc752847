"""Flight logs of a folder: LOG_REQUEST_LIST (117) to LOG_REQUEST_END (122). Ids are indices in a client's last list."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass

from colibri.mavlink.files.tree import ENTRY_US, Entry, Files, Names, OpenFile, entries_in
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.node.service import IDLE, Peer, Send, first_to_go, to
from colibri.mavlink.wire.dialect import Message

BLOCK_BYTES = 90
MESSAGES_A_POLL = 20
ERASED_A_POLL = 20
MESSAGES_A_POLL_OF_A_LONG_PART = 8
SHORT_BYTES = 256 * BLOCK_BYTES  # fits any client's socket buffer: MAVProxy requests whole logs, faster than it reads
MAX_TRANSFERS_OF_A_PEER = 32
MAX_PEERS = 16
LAST_ID = 0xFFFF

_UINT32_MAX = 0xFFFFFFFF


@dataclass(slots=True)
class _LogListing:
    peer: Peer
    next: int
    last: int


@dataclass(slots=True)
class _Transfer:
    peer: Peer
    id: int
    reading: OpenFile
    offset: int
    end: int


class Logs:
    """Serves the logs in a folder."""

    handles = frozenset({"LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_ERASE", "LOG_REQUEST_END"})

    def __init__(
        self,
        files: Files,
        folder: Names = (),
        being_written: Callable[[], str | None] = lambda: None,
        budget: Budget | None = None,
        *,
        suffix: str = "",
        first_id: int = 0,
    ) -> None:
        """Serve the files that end in `suffix`; that of `being_written` is not erased."""
        self._files, self._budget = files, budget or Budget()
        self._suffix, self._first_id = suffix, first_id
        self._folder = folder
        self._being_written = being_written
        self._shown: dict[Peer, list[Entry]] = {}
        self._listings: dict[Peer, _LogListing] = {}
        self._transfers: deque[_Transfer] = deque()
        self._erasing: dict[str, None] = {}

    def receive(self, message: Message, peer: Peer, _now_us: int) -> Iterable[Send]:
        fields = message.fields
        if message.name == "LOG_REQUEST_LIST":
            first = self._first_id
            return self._list(peer, max(fields.start - first, 0), fields.end - first)
        if message.name == "LOG_REQUEST_DATA":
            return self._transfer(peer, fields.id, fields.ofs, fields.count)
        if message.name == "LOG_ERASE":
            kept = self._being_written()
            self._erasing = {entry.name: None for entry in self._logs() if entry.name != kept}
            for known in (self._shown, self._listings, self._transfers):
                known.clear()
        elif message.name == "LOG_REQUEST_END":
            self._stop(peer)
        return ()

    def poll(self, _now_us: int) -> Iterable[Send]:
        if not self._transfers and not self._listings and not self._erasing:
            return IDLE
        for _ in range(min(len(self._erasing), ERASED_A_POLL)):
            with suppress(OSError):
                self._files.remove((*self._folder, self._erasing.popitem()[0]))
        sends: list[Send] = []
        share = MESSAGES_A_POLL // max(len(self._listings), 1)  # of at most `MAX_PEERS`
        for listing in list(self._listings.values()):
            sends += self._entries(listing, share)
        share = max(MESSAGES_A_POLL // max(len(self._transfers), 1), 1)
        for _ in range(min(len(self._transfers), MESSAGES_A_POLL)):
            transfer = self._transfers.popleft()
            is_long = transfer.end - transfer.offset > SHORT_BYTES
            sends += _blocks(transfer, min(share, MESSAGES_A_POLL_OF_A_LONG_PART) if is_long else share)
            if transfer.offset < transfer.end:
                self._transfers.append(transfer)
        return sends

    def _list(self, peer: Peer, start: int, end: int) -> Iterable[Send]:
        logs = self._look(peer)
        if not logs:  # "answered with one LOG_ENTRY message with id = 0 and num_logs = 0"
            return (to(peer, "LOG_ENTRY", 0, 0, 0, 0, 0),)
        self._listings[peer] = _LogListing(peer, start, min(end, len(logs) - 1))
        return ()

    def _entries(self, listing: _LogListing, at_most: int) -> Iterator[Send]:
        logs = self._shown.get(listing.peer, ())
        last = min(listing.last, len(logs) - 1)
        until = min(last + 1, listing.next + at_most)
        for number in range(listing.next, until):
            log, last_id = logs[number], len(logs) - 1 + self._first_id
            facts = (len(logs), last_id, log.modified_s & _UINT32_MAX, min(log.size, _UINT32_MAX))
            yield to(listing.peer, "LOG_ENTRY", number + self._first_id, *facts)
        listing.next = until
        if until > last:
            self._listings.pop(listing.peer, None)

    def _look(self, peer: Peer) -> list[Entry]:
        logs = [entry for entry in self._logs() if entry.name not in self._erasing]
        self._shown.pop(peer, None)
        if len(self._shown) >= MAX_PEERS:
            forgotten = first_to_go(self._shown)
            del self._shown[forgotten]
            self._stop(forgotten)
        self._shown[peer] = logs[-LAST_ID:]
        return self._shown[peer]

    def _transfer(self, peer: Peer, number: int, offset: int, count: int) -> Iterable[Send]:
        logs = self._shown.pop(peer) if peer in self._shown else self._look(peer)
        self._shown[peer] = logs  # last in line to be forgotten
        place, reading = number - self._first_id, None
        with suppress(OSError):
            reading = self._files.open((*self._folder, logs[place].name)) if 0 <= place < len(logs) else None
        if reading is None or offset >= reading.size or count == 0:
            return (_block(peer, number, offset, b""),)  # "zero for end of log"
        transfer = _Transfer(peer, number, reading, offset, offset + count)
        # A client that asks for another log has turned away from the one before.
        self._transfers = deque(known for known in self._transfers if known.peer != peer or known.id == number)
        of_peer = [known for known in self._transfers if known.peer == peer]
        asked = (number, transfer.end)
        asked_again = any((known.id, known.end) == asked and known.offset <= offset for known in of_peer)
        if not asked_again and len(of_peer) < MAX_TRANSFERS_OF_A_PEER:
            self._transfers.append(transfer)
        return ()

    def _logs(self) -> list[Entry]:
        entries = entries_in(self._files, self._folder)
        self._budget.spend(ENTRY_US * len(entries))
        return [entry for entry in entries if not entry.is_folder and entry.name.endswith(self._suffix)]

    def _stop(self, peer: Peer) -> None:
        self._listings.pop(peer, None)
        self._transfers = deque(transfer for transfer in self._transfers if transfer.peer != peer)


def _blocks(transfer: _Transfer, maximum: int) -> Iterator[Send]:
    """Yield the next blocks; an empty one marks the end after a full one."""
    wanted = min(maximum * BLOCK_BYTES, transfer.end - transfer.offset)
    data = b""
    with suppress(OSError):
        data = transfer.reading.read(transfer.offset, wanted)
    for start in range(0, len(data), BLOCK_BYTES):
        yield _block(transfer.peer, transfer.id, transfer.offset + start, data[start : start + BLOCK_BYTES])
    transfer.offset += len(data)
    if len(data) < wanted:
        if len(data) % BLOCK_BYTES == 0:
            yield _block(transfer.peer, transfer.id, transfer.offset, b"")
        transfer.end = transfer.offset


def _block(peer: Peer, number: int, offset: int, data: bytes) -> Send:
    return to(peer, "LOG_DATA", number, offset, len(data), data.ljust(BLOCK_BYTES, b"\0"))
