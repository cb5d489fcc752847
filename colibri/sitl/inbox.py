"""What somebody who listens to a vehicle has heard of it."""

from collections import Counter, defaultdict
from typing import Any

from colibri.mavlink.wire.dialect import Codec, Message, mav

_STATUSTEXT = int(mav.MAVLINK_MSG_ID_STATUSTEXT).to_bytes(3, "little")


class Hearing:
    """What was heard.

    Attributes:
        heard: Messages, as their fields, by name, the latest last.
        counts: How many were heard, by name.
        acks: Every COMMAND_ACK, in order, whoever it is for.
        texts: Every STATUSTEXT, in order.
    """

    def __init__(self, remembers: int = 20_000) -> None:
        """Have heard nothing yet; of one name so many messages are remembered, at least the last half of them."""
        self._remembers = remembers
        self.heard: defaultdict[str, list[Any]] = defaultdict(list)
        self.counts: Counter[str] = Counter()
        self.acks: list[Any] = []
        self.texts: list[str] = []

    def latest(self, name: str) -> Any:
        """Return the last message of a name, as its fields."""
        assert self.heard[name], f"no {name} was heard"
        return self.heard[name][-1]

    def said(self, part: str) -> bool:
        """Whether a STATUSTEXT of the vehicle's has said so."""
        return any(part in text for text in self.texts)

    def forget(self) -> None:
        """Forget all that was heard up to now."""
        self.heard.clear()
        self.counts.clear()
        self.acks.clear()
        self.texts.clear()

    def hear(self, message: Message) -> None:
        """Take in a message of the vehicle's."""
        name, fields = message.name, message.fields
        self.counts[name] += 1
        kept = self.heard[name]
        kept.append(fields)
        if len(kept) > self._remembers:
            del kept[: self._remembers // 2]
        if name == "COMMAND_ACK":
            self.acks.append(fields)
        elif name == "STATUSTEXT":
            self._hear_text(fields)

    def _hear_text(self, fields: Any) -> None:
        """Take in a line; a long one comes in chunks of 50 characters."""
        if fields.chunk_seq and self.texts:
            self.texts[-1] += fields.text
        else:
            self.texts.append(fields.text)


class Words(Hearing):
    """Every STATUSTEXT that a vehicle sends to one listener, heard where it is sent: no link loses it."""

    def __init__(self) -> None:
        """Have heard nothing yet."""
        super().__init__()
        self._codec = Codec(0, 0)

    def overhear(self, datagram: bytes) -> None:
        """Take in a datagram that is sent."""
        if _STATUSTEXT not in datagram:  # most have none: what costs time is to decode them
            return
        for message in self._codec.decode(datagram):
            if message.name == "STATUSTEXT":
                self.hear(message)
