"""What the tests of services need: messages as they arrive, and arbitrary ones."""

from collections.abc import Iterable
from typing import Any

from hypothesis import strategies as st

from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.wire.dialect import Codec, Message

GROUND = Peer(1, 245, 190)
OTHER = Peer(2, 255, 230)
NAN = float("nan")


def message(name: str, *fields: Any, peer: Peer = GROUND) -> Message:
    codec = Codec(peer.system, peer.component)
    (received,) = codec.decode(codec.encode(name, *fields))
    return received


def command_long(command: int, *params: float, confirmation: int = 0) -> Message:
    """Return a COMMAND_LONG; parameters that are left out are zero."""
    return message("COMMAND_LONG", 1, 1, command, confirmation, *params, *(0.0,) * (7 - len(params)))


def command_int(command: int, *params: float, frame: int = 0, x: int = 0, y: int = 0, z: float = 0.0) -> Message:
    return message("COMMAND_INT", 1, 1, frame, command, 0, 0, *params, *(0.0,) * (4 - len(params)), x, y, z)


def on_the_wire(sends: Iterable[Send]) -> list[Message]:
    """Return messages that are sent as they arrive: they can be encoded."""
    codec = Codec(1, 1)
    return [received for send in sends for received in codec.decode(codec.encode(send.name, *send.fields))]


FLOATS = st.floats(width=32)
BYTES = st.integers(0, 255)
ANY_LONG = st.tuples(st.integers(0, 500) | st.integers(0, 65535), BYTES, *[FLOATS] * 7).map(
    lambda f: message("COMMAND_LONG", 1, 1, f[0], f[1], *f[2:])
)
INT32 = st.integers(-(2**31), 2**31 - 1)
PEERS = st.builds(Peer, st.integers(1, 3), BYTES, BYTES)
