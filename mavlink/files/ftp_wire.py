"""Wire format of the file transfer protocol: https://mavlink.io/en/services/ftp.html."""

from enum import IntEnum
from errno import EACCES, EEXIST, EIO, ELOOP, ENOENT, EPERM, EROFS
from struct import Struct
from typing import NamedTuple, TypeAlias

from colibri.mavlink.files.tree import Entry, Names, names_of, refused
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

_ERRORS = {
    ENOENT: FtpError.NOT_FOUND,
    EEXIST: FtpError.EXISTS,
    **dict.fromkeys((EACCES, ELOOP, EPERM, EROFS), FtpError.PROTECTED),
}
"""All other errors of files are FAIL_ERRNO."""

Key: TypeAlias = tuple[Peer, int]  # a session: client and number


class NakError(Exception):
    """A refused request; `args` has its FtpError, and the errno with FAIL_ERRNO."""


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

    def path(self, number: int = 0) -> Names:
        """Return a path in the data; () if it is missing."""
        try:
            return names_of((*self.data.split(b"\0"), b"")[number].decode())
        except UnicodeDecodeError:
            raise refused(ENOENT) from None

    def answer(self, data: bytes, opcode: Opcode = Opcode.ACK, *, last: bool = False) -> Send:
        sequence, peer = (self.sequence + 1) % 0x10000, self.peer
        header = _HEADER.pack(sequence, self.session, opcode, len(data), self.opcode, last, self.offset)
        payload = (header + data).ljust(PAYLOAD_BYTES, b"\0")
        return to(peer, "FILE_TRANSFER_PROTOCOL", 0, peer.system, peer.component, payload)

    def refusal(self, error: OSError | NakError) -> Send:
        reason = error.args
        if isinstance(error, OSError):
            number = error.errno or EIO
            reason = (_ERRORS[number],) if number in _ERRORS else (FtpError.FAIL_ERRNO, number & 0xFF)
        return self.answer(bytes(reason), Opcode.NAK)


def line_of(entry: Entry, *, with_time: bool) -> bytes:
    """Return an entry's line in a listing; "S" (skip) if unlistable, to keep later entries' numbers."""
    name = entry.name.encode(errors="replace")
    kind = b"D" if entry.is_folder else b"F"
    facts = b"\t%d\t%d" % (entry.size, entry.modified_s) if with_time else b"\t%d" % entry.size
    if entry.is_folder and not with_time:  # as PX4 and ArduPilot do: clients would show the size as part of the name
        facts = b""
    line = kind + name + facts + b"\0"
    return line if entry.name.isprintable() and len(line) <= DATA_BYTES else b"S\0"
