"""Follow-me: the target's state from FOLLOW_TARGET. Zero is an unknown velocity."""

from math import hypot, isfinite, isnan
from typing import Any

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, enu_of
from colibri.common.types import Vector
from colibri.mavlink.node.service import Peer
from colibri.mavlink.services.statustext import StatusText
from colibri.mavlink.setpoints.arbitration import Refused, StreamedService
from colibri.mavlink.setpoints.setpoints import STILL, TargetState
from colibri.mavlink.wire.dialect import Message
from colibri.mavlink.wire.ned import ned_from_enu
from colibri.mavlink.wire.places import MAX_DISTANCE_M, misplaced

POSITION_KNOWN = 1
MAX_SPEED_M_S = 100.0
MAX_ACCELERATION_M_S2 = 100.0
SILENT_AFTER_US = 3_000_000  # trackers send a position once a second
GOES_ON_US = 2_000_000  # extrapolation at the last velocity; then the target is assumed to stand
_DEG = 1e-7


class Follow(StreamedService[TargetState]):
    """Keeps each tracker's latest target."""

    handles = frozenset({"FOLLOW_TARGET"})

    def __init__(self, text: StatusText | None = None) -> None:
        super().__init__(SILENT_AFTER_US, text)
        self._origin = DEFAULT_ORIGIN

    def update(self, origin: Geodetic) -> None:
        self._origin = origin

    def latest(self, now_us: int, timeout_us: int) -> TargetState | None:
        target = self._latest(now_us, timeout_us)
        return target.at(now_us, GOES_ON_US) if target else None

    def _decode(self, message: Message, _peer: Peer, now_us: int) -> TargetState:
        fields = message.fields
        if not fields.est_capabilities & POSITION_KNOWN:
            raise Refused("no position", f"est_capabilities {fields.est_capabilities}")
        latitude, longitude, altitude_m = fields.lat * _DEG, fields.lon * _DEG, fields.alt
        if not isfinite(altitude_m):
            raise Refused("not finite", f"altitude {altitude_m:g}")
        wrong = misplaced(latitude, longitude)
        if wrong:
            raise Refused("out of range", wrong)
        position = enu_of(Geodetic(latitude, longitude, altitude_m), self._origin)
        velocity, acceleration = _known(fields.vel), _known(fields.acc)
        if not all(map(isfinite, (*velocity, *acceleration))):
            raise Refused("not finite", "velocity or acceleration")
        for name, vector, maximum in (
            ("distance", position, MAX_DISTANCE_M),
            ("speed", velocity, MAX_SPEED_M_S),
            ("acceleration", acceleration, MAX_ACCELERATION_M_S2),
        ):
            if hypot(*vector) > maximum:
                raise Refused("out of range", f"{name} {hypot(*vector):g}, more than {maximum:g}")
        return TargetState(position, velocity, acceleration, now_us, now_us)


def _known(ned: Any) -> Vector:
    north, east, down = ned
    return STILL if isnan(north) or isnan(east) or isnan(down) else ned_from_enu((north, east, down))
