"""Wire format of the file transfer protocol: https://mavlink.io/en/services/ftp.html."""

from enum import IntEnum
from struct import Struct
from typing import NamedTuple, TypeAlias

from colibri.mavlink.files.tree import Entry, FileRefusal, Names, names_of
from colibri.mavlink.node.service import Peer, Send, to

PAYLOAD_BYTES = 251
DATA_BYTES = 239


class Opcode(IntEnum):
    NONE = 0
    TERMINATE = 1
    RESET = 2
    LIST = 3
    OPEN_TO_READ = 4
    READ = 5
    CREATE = 6
    WRITE = 7
    REMOVE = 8
    MAKE_FOLDER = 9
    REMOVE_FOLDER = 10
    OPEN_TO_WRITE = 11
    TRUNCATE = 12
    RENAME = 13
    CHECKSUM = 14
    BURST = 15
    LIST_WITH_TIME = 16
    ACK = 128
    NAK = 129


class FtpError(IntEnum):
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    EXISTS = 8
    PROTECTED = 9
    NOT_FOUND = 10


SIZE = Struct("<I")  # a file's size, or its checksum, in an answer
_HEADER = Struct("<HBBBBBxI")

Key: TypeAlias = tuple[Peer, int]  # a session: client and number


class Request(NamedTuple):
    peer: Peer
    now_us: int
    payload: bytes
    sequence: int
    session: int
    opcode: int
    size: int  # of the data, or number of bytes to read
    offset: int  # in a file, or among the entries of a folder
    data: bytes

    @classmethod
    def received(cls, payload: bytes, peer: Peer, now_us: int) -> "Request":
        payload = payload.ljust(PAYLOAD_BYTES, b"\0")
        sequence, session, opcode, size, _, _, offset = _HEADER.unpack_from(payload)
        return cls(peer, now_us, payload, sequence, session, opcode, size, offset, payload[_HEADER.size :][:size])

    @property
    def key(self) -> Key:
        return self.peer, self.session

    def paths(self) -> list[Names | FileRefusal]:
        return [_path_in(text) for text in self.data.split(b"\0")]

    def answer(self, outcome: "bytes | Nak | FileRefusal", *, last: bool = False) -> Send:
        opcode, peer = Opcode.ACK, self.peer
        if isinstance(outcome, FileRefusal):
            outcome = Nak(_ERRORS[outcome]) if outcome in _ERRORS else Nak(FtpError.FAIL_ERRNO, outcome.value)
        if isinstance(outcome, Nak):
            opcode = Opcode.NAK
            outcome = bytes(outcome) if outcome.errno else bytes(outcome[:1])
        sequence = (self.sequence + 1) % 0x10000
        header = _HEADER.pack(sequence, self.session, opcode, len(outcome), self.opcode, last, self.offset)
        payload = (header + outcome).ljust(PAYLOAD_BYTES, b"\0")
        return to(peer, "FILE_TRANSFER_PROTOCOL", 0, peer.system, peer.component, payload)


def _path_in(text: bytes) -> Names | FileRefusal:
    try:
        return names_of(text.decode())
    except UnicodeDecodeError:
        return FileRefusal.NOT_FOUND


class Nak(NamedTuple):
    """A refusal; errno with FAIL_ERRNO."""

    error: FtpError
    errno: int = 0


_ERRORS = {
    FileRefusal.NOT_FOUND: FtpError.NOT_FOUND,
    FileRefusal.EXISTS: FtpError.EXISTS,
    FileRefusal.PROTECTED: FtpError.PROTECTED,
}
"""All other refusals are FAIL_ERRNO."""


def line_of(entry: Entry, *, with_time: bool) -> bytes:
    """Return an entry's line in a listing; "S" (skip) if unlistable, to keep later entries' numbers."""
    name = entry.name.encode(errors="replace")
    kind = b"D" if entry.is_folder else b"F"
    facts = b"\t%d\t%d" % (entry.size, entry.modified_s) if with_time else b"\t%d" % entry.size
    if entry.is_folder and not with_time:  # as PX4 and ArduPilot do: clients would show the size as part of the name
        facts = b""
    line = kind + name + facts + b"\0"
    return line if entry.name.isprintable() and len(line) <= DATA_BYTES else b"S\0"
