"""Follow-me: where the target is, as FOLLOW_TARGET tells it.

Specification: https://mavlink.io/en/messages/common.html#FOLLOW_TARGET. Never answered. Of `est_capabilities` only the
position's bit is asked for: velocity counts where it is finite, since the message itself says that (0, 0, 0) is an
unknown one, and clients that send one leave its bit out.
"""

from collections import Counter
from collections.abc import Iterable
from math import hypot, isfinite, isnan
from typing import Any

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic, enu_of, is_on_earth
from colibri.common.types import Vector
from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.setpoints.arbitration import Streams
from colibri.mavlink.setpoints.setpoints import STILL, TargetState
from colibri.mavlink.wire.dialect import Message
from colibri.mavlink.wire.ned import ned_from_enu

POSITION_KNOWN = 1
MAX_DISTANCE_M = 1e6
MAX_SPEED_M_S = 100.0
MAX_ACCELERATION_M_S2 = 100.0
SILENT_AFTER_US = 3_000_000
"""Trackers tell a position once a second."""
GOES_ON_US = 2_000_000
"""A target that is not heard of goes on at its velocity for so long, then it is taken to stand."""
_DEG = 1e-7


class Follow:
    """Keeps the latest state of the target of the tracker that is obeyed; see `streams` for which that is.

    Attributes:
        handles: FOLLOW_TARGET.
        dropped: Messages that were not taken, by reason.
    """

    handles = frozenset({"FOLLOW_TARGET"})

    def __init__(self) -> None:
        """No target yet."""
        self.dropped: Counter[str] = Counter()
        self._streams: Streams[TargetState] = Streams(SILENT_AFTER_US)
        self._origin = DEFAULT_ORIGIN

    def update(self, origin: Geodetic) -> None:
        """Know where the ENU frame has its origin."""
        self._origin = origin

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Take in a target; there is never an answer."""
        target = self._decode(message.fields, now_us)
        if isinstance(target, str):
            self.dropped[target] += 1
        elif not self._streams.hear(peer, target, now_us):
            self.dropped["another client"] += 1
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        """Nothing is ever due."""
        del now_us
        return ()

    def engage(self, peer: Peer, now_us: int) -> None:
        """Follow the target of `peer`, who has just asked for the mode, rather than another's."""
        self._streams.claim(peer, now_us)

    def latest(self, now_us: int, timeout_us: int) -> TargetState | None:
        """Return where the target is by now, if it was told no longer ago than `timeout_us`."""
        heard = self._streams.latest(now_us, timeout_us)
        return heard.value.at(now_us, GOES_ON_US) if heard else None

    def _decode(self, fields: Any, now_us: int) -> TargetState | str:
        """Return the target, or why it is none."""
        if not fields.est_capabilities & POSITION_KNOWN:
            return "no position"
        latitude, longitude, altitude_m = fields.lat * _DEG, fields.lon * _DEG, fields.alt
        if not isfinite(altitude_m):
            return "not finite"
        if not is_on_earth(latitude, longitude):
            return "out of range"
        position = enu_of(Geodetic(latitude, longitude, altitude_m), self._origin)
        velocity, acceleration = _known(fields.vel), _known(fields.acc)
        if not all(map(isfinite, (*velocity, *acceleration))):
            return "not finite"
        if (
            hypot(*position) > MAX_DISTANCE_M
            or hypot(*velocity) > MAX_SPEED_M_S
            or hypot(*acceleration) > MAX_ACCELERATION_M_S2
        ):
            return "out of range"
        return TargetState(position, velocity, acceleration, now_us, now_us)


def _known(ned: Any) -> Vector:
    """Return a vector in ENU, zero where it is not known."""
    north, east, down = ned
    return STILL if isnan(north) or isnan(east) or isnan(down) else ned_from_enu((north, east, down))
