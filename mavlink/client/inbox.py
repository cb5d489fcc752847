"""Storage of received messages for later inspection."""

from collections import Counter
from typing import Any

from colibri.common.errors import unknown
from colibri.mavlink.wire.dialect import Message, mav

__tracebackhide__ = True  # a failed test shows its own lines, not these


class Heard(dict[str, list[Any]]):
    """Fields of received messages by name; empty for messages not received yet."""

    def __missing__(self, name: str) -> list[Any]:
        names = [it.msgname for it in mav.mavlink_map.values()]
        if name not in names:
            raise ValueError(unknown("message", name, names))
        messages = self[name] = []
        return messages


class Inbox:
    def __init__(self, remembers: int = 20_000) -> None:
        self._remembers = remembers
        self.heard = Heard()  # fields by name, the latest last
        self.counts: Counter[str] = Counter()
        self.acks: list[Any] = []  # every COMMAND_ACK, for any receiver
        self.texts: list[str] = []  # every STATUSTEXT

    def latest(self, name: str) -> Any:
        """Return the last message of a name, as its fields."""
        assert self.heard[name], f"no {name} was received"
        return self.heard[name][-1]

    def said(self, part: str) -> bool:
        """Whether a STATUSTEXT contains `part`."""
        return any(part in text for text in self.texts)

    def forget(self) -> None:
        """Delete everything received so far."""
        self.heard.clear()
        self.counts.clear()
        self.acks.clear()
        self.texts.clear()

    def add(self, message: Message) -> None:
        name, fields = message.name, message.fields
        self.counts[name] += 1
        kept = self.heard[name]
        kept.append(fields)
        if len(kept) > self._remembers:
            del kept[: self._remembers // 2]
        if name == "COMMAND_ACK":
            self.acks.append(fields)
        elif name == "STATUSTEXT" and fields.chunk_seq and self.texts:
            self.texts[-1] += fields.text
        elif name == "STATUSTEXT":
            self.texts.append(fields.text)
