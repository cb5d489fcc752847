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
from zlib import crc32

from colibri.mavlink.files.ftp_wire import DATA_BYTES, SIZE, FtpError, Key, NakError, Opcode, Request, line_of
from colibri.mavlink.files.tree import ENTRY_US, Files, Names, OpenFile
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
        self._remembered: dict[tuple[Peer, bytes], int] = {}  # changes made, and until when their requests are known
        self._obey: dict[int, Callable[[Request], bytes | None]] = {
            Opcode.NONE: lambda _: b"",
            Opcode.TERMINATE: self._terminate,
            Opcode.RESET: self._reset,
            Opcode.READ: self._read,
            Opcode.BURST: self._begin_burst,
            Opcode.WRITE: self._write,
        }
        self._obey_on_path: dict[int, Callable[[Request, Names], bytes | None]] = {
            Opcode.LIST: self._list,
            Opcode.LIST_WITH_TIME: self._list,
            Opcode.OPEN_TO_READ: self._open_to_read,
            Opcode.CHECKSUM: self._begin_checksum,
        }
        self._change: dict[int, Callable[[Request, Names], None]] = {
            Opcode.CREATE: self._create,
            Opcode.OPEN_TO_WRITE: self._open_to_write,
            Opcode.TRUNCATE: self._truncate,
            Opcode.REMOVE: lambda _, names: files.remove(names),
            Opcode.MAKE_FOLDER: lambda _, names: files.make_folder(names),
            Opcode.REMOVE_FOLDER: lambda _, names: files.remove_folder(names),
            Opcode.RENAME: self._rename,
        }

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        request = Request.received(bytes(message.fields.payload), peer, now_us)
        if request.opcode in (Opcode.ACK, Opcode.NAK):  # of another server, and to answer it would begin a quarrel
            return ()
        self._forget(now_us)
        try:
            data = self._outcome(request)
        except (OSError, NakError) as error:
            return (request.refusal(error),)
        return () if data is None else (request.answer(data),)

    def poll(self, _now_us: int) -> Iterable[Send]:
        if not self._bursts and not self._checksums:
            return IDLE
        sends: list[Send] = []
        for key in list(self._bursts)[:BURST_PACKETS_A_POLL]:
            burst = self._bursts.pop(key)  # to go to the end of the line
            sends += _packets(burst, max(BURST_PACKETS_A_POLL // (len(self._bursts) + 1), 1))
            if burst.packets_left:
                self._bursts[key] = burst
        for key in list(self._checksums)[:1]:
            checksum = self._checksums.pop(key)
            try:
                data = _sum(checksum)
            except OSError as error:
                sends.append(checksum.request.refusal(error))
                continue
            if data is None:
                self._checksums[key] = checksum
            else:
                sends.append(checksum.request.answer(data))
        return sends

    def _outcome(self, request: Request) -> bytes | None:
        """Return the data of the answer; `None` if it follows later."""
        opcode = request.opcode
        if request.size > DATA_BYTES:
            raise NakError(FtpError.INVALID_DATA_SIZE)
        if opcode in self._obey:
            return self._obey[opcode](request)
        if opcode in self._obey_on_path:
            return self._obey_on_path[opcode](request, request.path())
        if opcode not in self._change:
            raise NakError(FtpError.UNKNOWN_COMMAND)
        asked = (request.peer, request.payload)
        if asked not in self._remembered:  # a change is made once, however often the identical request is repeated
            self._change[opcode](request, request.path())
            if len(self._remembered) >= MAX_REMEMBERED:
                del self._remembered[next(iter(self._remembered))]
            self._remembered[asked] = request.now_us + REMEMBERED_FOR_US
        return b""

    def _forget(self, now_us: int) -> None:
        for key, session in list(self._sessions.items()):
            if now_us - session.used_us > SESSION_ENDS_AFTER_US:
                self._close(key)
        for asked, until_us in list(self._remembered.items()):
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

    def _list(self, request: Request, names: Names) -> bytes:
        found = self._files.list(names)
        self._budget.spend(PATH_US + ENTRY_US * len(found))
        if request.offset >= len(found):
            raise NakError(FtpError.END_OF_FILE)
        data = b""
        for entry in found[request.offset :]:
            line = line_of(entry, with_time=request.opcode == Opcode.LIST_WITH_TIME)
            if len(data) + len(line) > DATA_BYTES:
                break
            data += line
        return data

    def _open_to_read(self, request: Request, names: Names) -> bytes:
        self._budget.spend(PATH_US)
        reading = self._files.open(names)
        self._open(request, names, reading)
        return SIZE.pack(min(reading.size, _UINT32_MAX))

    def _open_to_write(self, request: Request, names: Names) -> None:
        try:
            self._files.write(names, 0, b"")  # nothing is written here, but so it is known whether it may be
        except FileNotFoundError:
            self._create(request, names)
        else:
            self._open(request, names, None)

    def _create(self, request: Request, names: Names) -> None:
        self._need_session(request, names, None)
        self._files.create(names)
        self._open(request, names, None)

    def _open(self, request: Request, names: Names, reading: OpenFile | None) -> None:
        self._need_session(request, names, reading)
        self._close(request.key)
        self._sessions[request.key] = _Session(names, reading, request.now_us)

    def _need_session(self, request: Request, names: Names, reading: OpenFile | None) -> None:
        session = self._sessions.get(request.key)
        if session is None:
            free = self._has_room(request, self._sessions)
        else:
            again = session.names == names and (session.reading is None) == (reading is None)
            free = again or request.now_us - session.used_us >= TAKEN_OVER_AFTER_US
        if not free:
            raise NakError(FtpError.NO_SESSIONS)

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

    def _used(self, request: Request) -> _Session:
        session = self._sessions.get(request.key)
        if session is None:
            raise NakError(FtpError.INVALID_SESSION)
        session.used_us = request.now_us
        return session

    def _reading(self, request: Request) -> OpenFile:
        reading = self._used(request).reading
        if reading is None:
            raise NakError(FtpError.INVALID_SESSION)
        return reading

    def _read(self, request: Request) -> bytes:
        """Read part of a file; a burst continues meanwhile."""
        reading = self._reading(request)
        count = min(request.size or DATA_BYTES, reading.size - request.offset)
        return _some(reading, request.offset, count)

    def _begin_burst(self, request: Request) -> None:
        reading = self._reading(request)
        self._bursts.pop(request.key, None)
        if request.offset >= reading.size:
            raise NakError(FtpError.END_OF_FILE)
        self._bursts[request.key] = _Burst(request, reading)

    def _write(self, request: Request) -> bytes:
        session = self._used(request)
        if session.reading is not None:
            raise NakError(FtpError.PROTECTED)
        self._files.write(session.names, request.offset, request.data)
        return b""

    def _truncate(self, request: Request, names: Names) -> None:
        if request.offset > self._files.open(names).size:
            raise NakError(FtpError.END_OF_FILE)
        self._files.truncate(names, request.offset)

    def _rename(self, request: Request, old: Names) -> None:
        new = request.path(1)
        if not new:
            raise NakError(FtpError.INVALID_DATA_SIZE)
        self._files.rename(old, new)

    def _begin_checksum(self, request: Request, names: Names) -> bytes | None:
        running = self._checksums.get(request.key)
        if running is not None and running.names == names:
            running.request = request  # the client lost patience and asks again
            return None
        reading = self._files.open(names)
        if not self._has_room(request, self._checksums):
            raise NakError(FtpError.NO_SESSIONS)
        checksum = _Checksum(request, names, reading, request.now_us)
        data = _sum(checksum)
        if data is None:
            self._checksums[request.key] = checksum
        return data


def _some(reading: OpenFile, offset: int, count: int) -> bytes:
    """Return at most `count` bytes of a file, and at least one."""
    data = reading.read(offset, count) if count > 0 else b""
    if not data:
        raise NakError(FtpError.END_OF_FILE)
    return data


def _packets(burst: _Burst, maximum: int) -> Iterator[Send]:
    size = burst.request.size or DATA_BYTES
    wanted = min(maximum * size, burst.reading.size - burst.request.offset)
    try:
        data = _some(burst.reading, burst.request.offset, wanted)
    except (OSError, NakError) as error:  # the file was removed, or cut, since it was opened
        burst.packets_left = 0
        yield burst.request.refusal(error)
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


def _sum(checksum: _Checksum) -> bytes | None:
    """Continue a checksum; return it when it is complete."""
    reading = checksum.reading
    data = reading.read(checksum.done, min(CHECKSUM_BYTES_A_POLL, reading.size - checksum.done))
    checksum.register = crc32(data, checksum.register)
    checksum.done += len(data)
    if data and checksum.done < reading.size:
        return None
    # MAVLink's CRC32 begins with 0 and inverts nothing: https://mavlink.io/en/guide/crc.html.
    return SIZE.pack(checksum.register ^ _UINT32_MAX)
