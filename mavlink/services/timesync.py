"""The timesync and ping microservices: mavlink.io/en/services/timesync.html, mavlink.io/en/services/ping.html."""

from collections.abc import Iterable

from colibri.mavlink.node.service import Peer, Send, to
from colibri.mavlink.wire.dialect import Message

NS_PER_US = 1000
INT64_MAX = 2**63 - 1


class TimeService:
    """Answers time and ping requests; the clock cannot be set."""

    handles = frozenset({"TIMESYNC", "PING", "SYSTEM_TIME"})

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        fields = message.fields
        if message.name == "TIMESYNC" and fields.tc1 == 0:  # "tc1 is set to 0 in the request"
            return (to(peer, "TIMESYNC", min(now_us * NS_PER_US, INT64_MAX), fields.ts1),)
        if message.name == "PING" and fields.target_system == 0 and fields.target_component == 0:
            # "The response has the same time and sequence, and the target of whoever sent the request."
            return (to(peer, "PING", fields.time_usec, fields.seq, peer.system, peer.component),)
        return ()
