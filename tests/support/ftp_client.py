"""A client of file transfer, which asks the service itself and sees that every answer is well formed."""

from struct import Struct
from typing import NamedTuple

from colibri.mavlink.files.ftp import Ftp
from colibri.mavlink.files.ftp_wire import DATA_BYTES, FtpError, Opcode
from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.wire.dialect import Codec

HEADER = Struct("<HBBBBBBI")
PEER = Peer(3, 245, 190)
OTHER = Peer(4, 255, 230)
POLL_US = 4000


class Reply(NamedTuple):
    sequence: int
    session: int
    opcode: int
    size: int
    req_opcode: int
    burst_complete: int
    padding: int
    offset: int
    data: bytes

    @property
    def error(self) -> int:
        assert self.opcode == Opcode.NAK
        assert self.size == len(self.data) == (2 if self.data[0] == FtpError.FAIL_ERRNO else 1)
        return self.data[0]


def parsed(send: Send) -> Reply:
    (message,) = Codec(1, 1).decode(Codec(1, 1).encode(send.name, *send.fields))
    payload = bytes(message.fields.payload).ljust(251, b"\0")
    header = HEADER.unpack_from(payload)
    return Reply._make((*header, payload[HEADER.size :][: header[3]]))


class Client:
    def __init__(self, service: Ftp, peer: Peer = PEER, session: int = 0) -> None:
        self.service = service
        self.peer = peer
        self.session = session
        self.sequence = 0
        self.now_us = 0

    def send(self, opcode: int, data: bytes = b"", offset: int = 0, size: int | None = None) -> list[Reply]:
        size = len(data) if size is None else size
        header = HEADER.pack(self.sequence % 0x10000, self.session, opcode, size, 0, 0, 0, offset)
        fields = (0, 1, 1, (header + data).ljust(251, b"\0"))
        (message,) = Codec(*self.peer[1:]).decode(Codec(*self.peer[1:]).encode("FILE_TRANSFER_PROTOCOL", *fields))
        sends = list(self.service.receive(message, self.peer, self.now_us))
        assert all(send.channel == self.peer.channel for send in sends)
        assert all(send.fields[:3] == (0, self.peer.system, self.peer.component) for send in sends)
        return [parsed(send) for send in sends]

    def ask(self, opcode: int, data: bytes = b"", offset: int = 0, size: int | None = None) -> Reply:
        self.sequence += 1
        (reply,) = self.send(opcode, data, offset, size)
        assert reply.sequence == (self.sequence + 1) % 0x10000
        assert (reply.session, reply.req_opcode) == (self.session, opcode)
        return reply

    def do(self, opcode: int, data: bytes = b"", offset: int = 0, size: int | None = None) -> bytes:
        reply = self.ask(opcode, data, offset, size)
        assert reply.opcode == Opcode.ACK, reply
        return reply.data

    def poll(self) -> list[Reply]:
        self.now_us += POLL_US
        return [parsed(send) for send in self.service.poll(self.now_us)]

    def burst(self, offset: int = 0, size: int = DATA_BYTES) -> list[Reply]:
        self.sequence += 1
        replies = self.send(Opcode.BURST, b"", offset, size)
        while not replies or not (replies[-1].burst_complete or replies[-1].opcode == Opcode.NAK):
            replies += self.poll()
        return replies

    def listed(self, path: bytes, opcode: int = Opcode.LIST) -> list[bytes]:
        entries: list[bytes] = []
        while True:
            reply = self.ask(opcode, path, offset=len(entries))
            if reply.opcode == Opcode.NAK:
                assert reply.error == FtpError.END_OF_FILE
                return entries
            assert reply.data.endswith(b"\0")
            entries += reply.data[:-1].split(b"\0")


TEXT = bytes(range(256)) * 20
