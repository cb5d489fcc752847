"""Messages that set what others set by commands: the origin, home, the mode.

SET_GPS_GLOBAL_ORIGIN is answered by GPS_GLOBAL_ORIGIN with the very integers that were sent, as MAVSDK waits for them;
SET_HOME_POSITION and SET_MODE are old ways of DO_SET_HOME and DO_SET_MODE, which ground stations still use.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from colibri.common.earth.geodesy import Geodetic, is_on_earth
from colibri.mavlink.node.service import Peer, Send, to_all
from colibri.mavlink.services.statustext import WARNING, StatusText
from colibri.mavlink.wire.dialect import Message

_LOWEST_MM, _HIGHEST_MM = -1_000_000, 20_000_000


class Setters(NamedTuple):
    """What obeys; each says why not, or nothing.

    Attributes:
        origin: Of the ENU frame.
        home: Where to return to.
        mode: (base mode, custom mode).
    """

    origin: Callable[[Geodetic], str]
    home: Callable[[Geodetic], str]
    mode: Callable[[int, int], str]


class OriginService:
    """Hears the messages.

    Attributes:
        hears: Their names.
    """

    hears = frozenset({"SET_GPS_GLOBAL_ORIGIN", "SET_HOME_POSITION", "SET_MODE"})

    def __init__(self, setters: Setters, text: StatusText) -> None:
        """Hand what is asked for to `setters`; say why it is refused."""
        self._setters = setters
        self._text = text

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Take in one message."""
        del peer
        fields = message.fields
        if message.name == "SET_MODE":
            return self._refused(self._setters.mode(fields.base_mode, fields.custom_mode))
        place = Geodetic(fields.latitude * 1e-7, fields.longitude * 1e-7, fields.altitude * 1e-3)
        on_earth = is_on_earth(place.latitude_deg, place.longitude_deg)
        if not on_earth or not _LOWEST_MM <= fields.altitude <= _HIGHEST_MM:
            return self._refused("refused: not a latitude, longitude and altitude")
        if message.name == "SET_HOME_POSITION":
            return self._refused(self._setters.home(place))
        reason = self._setters.origin(place)
        if reason:
            return self._refused(reason)
        return [to_all("GPS_GLOBAL_ORIGIN", fields.latitude, fields.longitude, fields.altitude, now_us)]

    def poll(self, now_us: int) -> Iterable[Send]:
        """Nothing is ever due."""
        del now_us
        return ()

    def _refused(self, reason: str) -> list[Send]:
        return self._text.say(WARNING, reason) if reason else []
