"""The STATUSTEXT messages of a vehicle, read before the link loses any."""

from colibri.mavlink.client.inbox import Inbox
from colibri.mavlink.wire.dialect import Codec, mav

_STATUSTEXT = int(mav.MAVLINK_MSG_ID_STATUSTEXT).to_bytes(3, "little")


class StatusTexts(Inbox):
    """The texts of a vehicle with the times of sending."""

    def __init__(self) -> None:
        super().__init__()
        self._codec = Codec(0, 0)
        self.times_us: list[int] = []

    def add_datagram(self, datagram: bytes, now_us: int) -> None:
        if _STATUSTEXT not in datagram:  # most have none: what costs time is to decode them
            return
        for message in self._codec.decode(datagram):
            if message.name == "STATUSTEXT":
                self.add(message)
                self.times_us += [now_us] * (len(self.texts) - len(self.times_us))
