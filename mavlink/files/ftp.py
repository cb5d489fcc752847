"""The file transfer protocol of the vehicle: https://mavlink.io/en/services/ftp.html.

Choices where the specification leaves them, or clients deviate:

- The client chooses the session number (PX4 and MAVSDK only use 0), so sessions are per client, and every answer echoes
  the number.
- Each channel may have few sessions. Where all are taken, the channel with most loses its oldest.
- A client that reopens a session number after a moment's idleness takes it over; before, it is refused.
- MAVSDK repeats a request with a new sequence number, so operations are idempotent where possible.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeAlias
from zlib import crc32

from colibri.mavlink.files.ftp_wire import DATA_BYTES, SIZE, FtpError, Key, Nak, Opcode, Request, line_of
from colibri.mavlink.files.tree import ENTRY_US, FileRefusal, Files, Names, OpenFile
from colibri.mavlink.node.budget import Budget
from colibri.mavlink.node.service import IDLE, Peer, Send
from colibri.mavlink.wire.dialect import Message

PATH_US = 400.0  # work to find a file or folder, or to generate a file
MAX_SESSIONS = 32
MAX_SESSIONS_OF_A_CHANNEL = 8
SESSION_ENDS_AFTER_US = 20_000_000
TAKEN_OVER_AFTER_US = 1_000_000  # twice MAVSDK's repeat interval

REMEMBERED_FOR_US = 3_000_000
MAX_REMEMBERED = 64

BURST_PACKETS_A_POLL = 8
MAX_BURST_PACKETS = 1000  # limit of packets to a client that has gone
CHECKSUM_BYTES_A_POLL = 256 << 10

_UINT32_MAX = 0xFFFFFFFF

Outcome: TypeAlias = bytes | Nak | FileRefusal | None  # `None` if the answer follows later


@dataclass(slots=True)
class _Session:
    """An open file, for reading if `reading` is set, otherwise for writing."""

    names: Names
    reading: OpenFile | None
    used_us: int


@dataclass(slots=True)
class _Burst:
    request: Request
    reading: OpenFile
    packets_left: int = MAX_BURST_PACKETS


@dataclass(slots=True)
class _Checksum:
    request: Request
    names: Names
    reading: OpenFile
    used_us: int
    done: int = 0
    register: int = _UINT32_MAX


class Ftp:
    """Serves files."""

    handles = frozenset({"FILE_TRANSFER_PROTOCOL"})

    def __init__(self, files: Files, budget: Budget | None = None) -> None:
        self._files, self._budget = files, budget or Budget()
        self._sessions: dict[Key, _Session] = {}
        self._bursts: dict[Key, _Burst] = {}
        self._checksums: dict[Key, _Checksum] = {}
        self._remembered: dict[tuple[Peer, bytes], tuple[int, Send]] = {}
        self._obey: dict[int, Callable[[Request], Outcome]] = {
            Opcode.NONE: lambda _: b"",
            Opcode.TERMINATE: self._terminate,
            Opcode.RESET: self._reset,
            Opcode.LIST: _on_path(self._list),
            Opcode.LIST_WITH_TIME: _on_path(self._list),
            Opcode.OPEN_TO_READ: _on_path(self._open_to_read),
            Opcode.READ: self._read,
            Opcode.BURST: self._begin_burst,
            Opcode.WRITE: self._write,
            Opcode.CHECKSUM: _on_path(self._begin_checksum),
        }
        self._change: dict[int, Callable[[Request], Outcome]] = {
            Opcode.CREATE: _on_path(self._create),
            Opcode.OPEN_TO_WRITE: _on_path(self._open_to_write),
            Opcode.TRUNCATE: _on_path(self._truncate),
            Opcode.REMOVE: _on_path(lambda _, names: files.remove(names) or b""),
            Opcode.MAKE_FOLDER: _on_path(lambda _, names: files.make_folder(names) or b""),
            Opcode.REMOVE_FOLDER: _on_path(lambda _, names: files.remove_folder(names) or b""),
            Opcode.RENAME: _on_path(self._rename),
        }

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        request = Request.received(bytes(message.fields.payload), peer, now_us)
        if request.opcode in (Opcode.ACK, Opcode.NAK):  # of another server, and to answer it would begin a quarrel
            return ()
        self._forget(now_us)
        outcome: Outcome = Nak(FtpError.UNKNOWN_COMMAND)
        if request.size > DATA_BYTES:
            outcome = Nak(FtpError.INVALID_DATA_SIZE)
        elif request.opcode in self._change:
            return (self._changed(request),)
        elif request.opcode in self._obey:
            outcome = self._obey[request.opcode](request)
        return () if outcome is None else (request.answer(outcome),)

    def poll(self, _now_us: int) -> Iterable[Send]:
        if not self._bursts and not self._checksums:
            return IDLE
        sends: list[Send] = []
        for key in list(self._bursts)[:BURST_PACKETS_A_POLL]:
            burst = self._bursts.pop(key)  # to go to the end of the line
            sends += self._packets(burst, max(BURST_PACKETS_A_POLL // (len(self._bursts) + 1), 1))
            if burst.packets_left:
                self._bursts[key] = burst
        for key in list(self._checksums)[:1]:
            checksum = self._checksums.pop(key)
            outcome = _sum(checksum)
            if outcome is None:
                self._checksums[key] = checksum
            else:
                sends.append(checksum.request.answer(outcome))
        return sends

    def _changed(self, request: Request) -> Send:
        """Make a change once, however often the identical request is repeated."""
        asked = (request.peer, request.payload)
        if asked in self._remembered:
            return self._remembered[asked][1]
        outcome = self._change[request.opcode](request)
        assert outcome is not None, "changes are made at once"
        done = request.answer(outcome)
        if isinstance(outcome, bytes):
            if len(self._remembered) >= MAX_REMEMBERED:
                del self._remembered[next(iter(self._remembered))]
            self._remembered[asked] = (request.now_us + REMEMBERED_FOR_US, done)
        return done

    def _forget(self, now_us: int) -> None:
        for key, session in list(self._sessions.items()):
            if now_us - session.used_us > SESSION_ENDS_AFTER_US:
                self._close(key)
        for asked, (until_us, _) in list(self._remembered.items()):
            if now_us > until_us:
                del self._remembered[asked]

    def _close(self, key: Key) -> None:
        """Close a session and forget its answers: the next client may repeat the requests."""
        self._sessions.pop(key, None)
        self._bursts.pop(key, None)
        for peer, payload in list(self._remembered):
            if (peer, payload[2]) == key:
                del self._remembered[peer, payload]

    def _terminate(self, request: Request) -> bytes:
        self._close(request.key)
        return b""

    def _reset(self, request: Request) -> bytes:
        peers = [*self._sessions, *((peer, payload[2]) for peer, payload in self._remembered)]
        for key in peers:
            if key[0] == request.peer:
                self._close(key)
        return b""

    def _list(self, request: Request, names: Names) -> Outcome:
        found = self._files.list(names)
        if isinstance(found, FileRefusal):
            return found
        self._budget.spend(PATH_US + ENTRY_US * len(found))
        if request.offset >= len(found):
            return Nak(FtpError.END_OF_FILE)
        data = b""
        for entry in found[request.offset :]:
            line = line_of(entry, with_time=request.opcode == Opcode.LIST_WITH_TIME)
            if len(data) + len(line) > DATA_BYTES:
                break
            data += line
        return data

    def _open_to_read(self, request: Request, names: Names) -> Outcome:
        self._budget.spend(PATH_US)
        reading = self._files.open(names)
        if isinstance(reading, FileRefusal):
            return reading
        refused = self._opened(request, names, reading)
        return refused or SIZE.pack(min(reading.size, _UINT32_MAX))

    def _open_to_write(self, request: Request, names: Names) -> Outcome:
        if self._files.open(names) is FileRefusal.NOT_FOUND:
            return self._create(request, names)
        # Nothing is written here, but so it is known whether it may be.
        return self._files.write(names, 0, b"") or self._opened(request, names, None) or b""

    def _create(self, request: Request, names: Names) -> Outcome:
        return (
            self._no_session(request, names, None)
            or self._files.create(names)
            or self._opened(request, names, None)
            or b""
        )

    def _opened(self, request: Request, names: Names, reading: OpenFile | None) -> Nak | None:
        refused = self._no_session(request, names, reading)
        if refused is None:
            self._close(request.key)
            self._sessions[request.key] = _Session(names, reading, request.now_us)
        return refused

    def _no_session(self, request: Request, names: Names, reading: OpenFile | None) -> Nak | None:
        session = self._sessions.get(request.key)
        if session is not None:
            again = session.names == names and (session.reading is None) == (reading is None)
            idle_us = request.now_us - session.used_us
            return None if again or idle_us >= TAKEN_OVER_AFTER_US else Nak(FtpError.NO_SESSIONS)
        return None if self._has_room(request, self._sessions) else Nak(FtpError.NO_SESSIONS)

    def _has_room(self, request: Request, taken: dict[Key, _Session] | dict[Key, _Checksum]) -> bool:
        of_channels = Counter(peer.channel for peer, _ in taken)
        own = of_channels[request.peer.channel]
        if len(taken) < MAX_SESSIONS or own >= MAX_SESSIONS_OF_A_CHANNEL:
            return own < MAX_SESSIONS_OF_A_CHANNEL
        most = max(of_channels.values())
        if own >= most:
            return False
        crowd = (key for key in taken if of_channels[key[0].channel] == most)
        victim = min(crowd, key=lambda key: taken[key].used_us)
        self._close(victim)
        self._checksums.pop(victim, None)
        return True

    def _used(self, request: Request) -> _Session | None:
        session = self._sessions.get(request.key)
        if session is not None:
            session.used_us = request.now_us
        return session

    def _read(self, request: Request) -> Outcome:
        """Read part of a file; a burst continues meanwhile."""
        session = self._used(request)
        if session is None or session.reading is None:
            return Nak(FtpError.INVALID_SESSION)
        count = min(request.size or DATA_BYTES, session.reading.size - request.offset)
        if count <= 0:
            return Nak(FtpError.END_OF_FILE)
        return session.reading.read(request.offset, count) or Nak(FtpError.END_OF_FILE)

    def _begin_burst(self, request: Request) -> Outcome:
        session = self._used(request)
        if session is None or session.reading is None:
            return Nak(FtpError.INVALID_SESSION)
        self._bursts.pop(request.key, None)
        if request.offset >= session.reading.size:
            return Nak(FtpError.END_OF_FILE)
        self._bursts[request.key] = _Burst(request, session.reading)
        return None

    def _packets(self, burst: _Burst, maximum: int) -> Iterator[Send]:
        size = burst.request.size or DATA_BYTES
        wanted = min(maximum * size, burst.reading.size - burst.request.offset)
        data = burst.reading.read(burst.request.offset, wanted)
        if isinstance(data, FileRefusal) or not data:  # removed, or cut, since it was opened
            burst.packets_left = 0
            yield burst.request.answer(data or Nak(FtpError.END_OF_FILE))
            return
        for start in range(0, len(data), size):
            request, part = burst.request, data[start : start + size]
            end = request.offset + len(part)
            at_end = end >= burst.reading.size or len(part) < size
            burst.packets_left = 0 if at_end else burst.packets_left - 1
            yield request.answer(part, last=burst.packets_left == 0)
            burst.request = request._replace(sequence=request.sequence + 1, offset=end)
            if burst.packets_left == 0:
                return

    def _write(self, request: Request) -> Outcome:
        session = self._used(request)
        if session is None:
            return Nak(FtpError.INVALID_SESSION)
        if session.reading is not None:
            return Nak(FtpError.PROTECTED)
        return self._files.write(session.names, request.offset, request.data) or b""

    def _truncate(self, request: Request, names: Names) -> Outcome:
        reading = self._files.open(names)
        if isinstance(reading, FileRefusal):
            return reading
        if request.offset > reading.size:
            return Nak(FtpError.END_OF_FILE)
        return self._files.truncate(names, request.offset) or b""

    def _rename(self, request: Request, old: Names) -> Outcome:
        _, new, *_ = (*request.paths(), ())
        if isinstance(new, FileRefusal):
            return new
        if not new:
            return Nak(FtpError.INVALID_DATA_SIZE)
        return self._files.rename(old, new) or b""

    def _begin_checksum(self, request: Request, names: Names) -> Outcome:
        running = self._checksums.get(request.key)
        if running is not None and running.names == names:
            running.request = request  # the client lost patience and asks again
            return None
        reading = self._files.open(names)
        if isinstance(reading, FileRefusal):
            return reading
        if not self._has_room(request, self._checksums):
            return Nak(FtpError.NO_SESSIONS)
        checksum = _Checksum(request, names, reading, request.now_us)
        outcome = _sum(checksum)
        if outcome is None:
            self._checksums[request.key] = checksum
        return outcome


def _on_path(obey: Callable[[Request, Names], Outcome]) -> Callable[[Request], Outcome]:

    def obey_request(request: Request) -> Outcome:
        names = request.paths()[0]
        return names if isinstance(names, FileRefusal) else obey(request, names)

    return obey_request


def _sum(checksum: _Checksum) -> bytes | FileRefusal | None:
    reading = checksum.reading
    data = reading.read(checksum.done, min(CHECKSUM_BYTES_A_POLL, reading.size - checksum.done))
    if isinstance(data, FileRefusal):
        return data
    checksum.register = crc32(data, checksum.register)
    checksum.done += len(data)
    if data and checksum.done < reading.size:
        return None
    # MAVLink's CRC32 begins with 0 and inverts nothing: https://mavlink.io/en/guide/crc.html.
    return SIZE.pack(checksum.register ^ _UINT32_MAX)
