"""Where a vehicle's home and the origin of its local frame are on earth, asked for until it has said so."""

from typing import NamedTuple

from colibri.common.earth.geodesy import Geodetic
from colibri.companion.vehicle_peer import VehiclePeer
from colibri.mavlink.wire.dialect import mav

_AGAIN_US = 500_000


class Home(NamedTuple):
    """What places on earth and heights above home are measured from.

    Attributes:
        origin: Of the vehicle's local frame.
        up_m: Height of home in that frame, m.
    """

    origin: Geodetic
    up_m: float


class HomeSeeker:
    """Asks a vehicle for HOME_POSITION and GPS_GLOBAL_ORIGIN: bytes and the own time in, bytes out."""

    def __init__(self, peer: VehiclePeer) -> None:
        """Ask `peer`."""
        self._peer = peer
        self._again_us = 0

    @property
    def home(self) -> Home | None:
        """Where it is; None before the vehicle has said both."""
        home, origin = self._peer.report.home, self._peer.report.origin
        if home is None or origin is None:
            return None
        return Home(origin, home.altitude_m - origin.altitude_m)

    def receive(self, datagram: bytes, now_us: int) -> None:
        """Take in what the vehicle has sent."""
        self._peer.receive(datagram, now_us)

    def poll(self, now_us: int) -> list[bytes]:
        """Return what is to be sent now."""
        if self._peer.system and now_us >= self._again_us:
            self._again_us = now_us + _AGAIN_US
            for name in ("HOME_POSITION", "GPS_GLOBAL_ORIGIN"):
                number = float(getattr(mav, f"MAVLINK_MSG_ID_{name}"))
                self._peer.ask(name, mav.MAV_CMD_REQUEST_MESSAGE, number)
        return self._peer.poll(now_us)
