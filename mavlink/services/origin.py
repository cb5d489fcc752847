"""Messages to set origin, home and mode; the latter two are superseded by commands but still in use."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from colibri.common.earth.geodesy import Geodetic
from colibri.mavlink.node.service import Peer, Send, to, to_all
from colibri.mavlink.services.command import ACCEPTED
from colibri.mavlink.services.statustext import WARNING, StatusText
from colibri.mavlink.wire.dialect import Message, Refusal
from colibri.mavlink.wire.places import misplaced, misplaced_height

SET_MODE_ID = 11  # ArduPilot up to 4.5 acknowledges SET_MODE as this command


class Setters(NamedTuple):
    origin: Callable[[Geodetic], Refusal | None]
    home: Callable[[Geodetic], Refusal | None]
    mode: Callable[[int, int], Refusal | None]


class OriginService:
    """Sets origin, home and mode."""

    handles = frozenset({"SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "SET_MODE"})

    def __init__(self, setters: Setters, text: StatusText, *, acknowledges_mode: bool = False) -> None:
        self._setters, self._acknowledges_mode = setters, acknowledges_mode
        self._text = text

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        fields = message.fields
        if message.name == "SET_MODE":
            refusal = self._setters.mode(fields.base_mode, fields.custom_mode)
            result = ACCEPTED if refusal is None else refusal.result
            ack = to(peer, "COMMAND_ACK", SET_MODE_ID, result, 0, 0, peer.system, peer.component)
            return [*([ack] if self._acknowledges_mode else []), *self._refused(refusal)]
        place = Geodetic(fields.latitude * 1e-7, fields.longitude * 1e-7, fields.altitude * 1e-3)
        wrong = misplaced(place.latitude_deg, place.longitude_deg) or misplaced_height(place.altitude_m)
        if wrong:
            subject = "home" if message.name == "SET_HOME_POSITION" else "origin"
            return self._refused(Refusal(f"{subject} refused: {wrong}"))
        if message.name == "SET_HOME_POSITION":
            return self._refused(self._setters.home(place))
        refusal = self._setters.origin(place)
        if refusal is not None:
            return self._refused(refusal)
        return [to_all("GPS_GLOBAL_ORIGIN", fields.latitude, fields.longitude, fields.altitude, now_us)]

    def _refused(self, refusal: Refusal | None) -> list[Send]:
        return [] if refusal is None else self._text.say(WARNING, refusal.reason)
