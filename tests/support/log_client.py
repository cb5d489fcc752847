"""A client of log download on a link that loses datagrams both ways."""

import random
import socket
from contextlib import closing
from time import monotonic

from colibri.mavlink.client.client import Client
from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT
from tests.support.log_conversations import DownloadLog, ListLogs

LOSS = 0.2
_VEHICLE = (1, AUTOPILOT_COMPONENT)
_GIVE_UP_AFTER_S = 60.0


def downloaded(port: int, seed: int) -> tuple[bytes, int]:
    """Return the only log of the vehicle that waits on a port of this computer, and how many datagrams were lost."""
    client, chance, lost = Client(245, 190), random.Random(seed), 0
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sock:
        sock.connect(("127.0.0.1", port))
        sock.settimeout(0.02)

        def carry(conversation: Conversation) -> None:
            nonlocal lost
            client.begin(conversation)
            give_up_s = monotonic() + _GIVE_UP_AFTER_S
            while conversation.result is None:
                assert monotonic() < give_up_s, "the log does not come"
                now_us = round(monotonic() * 1e6)
                for datagram in client.poll(now_us):
                    if chance.random() < LOSS:
                        lost += 1
                    else:
                        sock.send(datagram)
                try:
                    datagram = sock.recv(4096)
                except TimeoutError:
                    continue
                if chance.random() < LOSS:
                    lost += 1
                else:
                    client.receive(datagram, now_us)
            assert conversation.accepted

        carry(logs := ListLogs(_VEHICLE))
        ((number, size),) = logs.sizes.items()
        carry(log := DownloadLog(_VEHICLE, number, size))
    return log.data, lost
