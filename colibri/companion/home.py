"""Request a vehicle's home and the origin of its local frame."""

from math import hypot
from typing import NamedTuple

from colibri.common.earth.geodesy import Geodetic, enu_of
from colibri.companion.vehicle_peer import VehiclePeer
from colibri.mavlink.client.report import VehicleReport
from colibri.mavlink.wire.dialect import mav

_AGAIN_US = 500_000


class LocalOrigin(NamedTuple):
    """Origin of the vehicle's local frame, and height of home in it."""

    origin: Geodetic
    up_m: float


def local_origin(report: VehicleReport) -> LocalOrigin | None:
    home, origin = report.home, report.origin
    if home is None or origin is None:
        return None
    return LocalOrigin(origin, home.altitude_m - origin.altitude_m)


class HomeSeeker:
    """Requests HOME_POSITION and GPS_GLOBAL_ORIGIN until both are known."""

    def __init__(self, peer: VehiclePeer) -> None:
        self._peer = peer
        self._again_us = 0

    @property
    def home(self) -> LocalOrigin | None:
        return local_origin(self._peer.report)

    def poll(self, now_us: int) -> list[bytes]:
        if self._peer.system and now_us >= self._again_us:
            self._again_us = now_us + _AGAIN_US
            for name in ("HOME_POSITION", "GPS_GLOBAL_ORIGIN"):
                number = float(getattr(mav, f"MAVLINK_MSG_ID_{name}"))
                self._peer.ask(name, mav.MAV_CMD_REQUEST_MESSAGE, number)
        return self._peer.poll(now_us)


def moved_m(planned: LocalOrigin | None, report: VehicleReport) -> float:
    """Return by how much the vehicle's home, or its local frame, has moved since a mission was placed, m."""
    now = local_origin(report)
    if planned is None or now is None:
        return 0.0
    return max(abs(now.up_m - planned.up_m), hypot(*enu_of(now.origin, planned.origin)))
