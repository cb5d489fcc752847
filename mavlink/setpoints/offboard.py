"""The offboard microservice: setpoints that a client streams.

Specification: https://mavlink.io/en/services/offboard_control.html. Setpoints are never answered. One that cannot be
flown is dropped and counted, and keeps no stream alive. SET_ACTUATOR_CONTROL_TARGET is ignored: only the
control law commands rotors.
"""

from collections.abc import Callable
from typing import Any

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.node.service import Peer
from colibri.mavlink.setpoints.arbitration import StreamedService
from colibri.mavlink.setpoints.decoding import Whereabouts, decode_attitude, decode_global, decode_local
from colibri.mavlink.setpoints.setpoints import OffboardSetpoint
from colibri.mavlink.telemetry.snapshot import Home
from colibri.mavlink.wire.dialect import Message

_DECODERS: dict[str, Callable[[Any, Whereabouts, int], OffboardSetpoint]] = {
    "SET_POSITION_TARGET_LOCAL_NED": decode_local,
    "SET_POSITION_TARGET_GLOBAL_INT": decode_global,
    "SET_ATTITUDE_TARGET": decode_attitude,
}


class Offboard(StreamedService[OffboardSetpoint]):
    """Keeps the latest offboard setpoint of each client; see `arbitration` for which client is obeyed."""

    handles = frozenset(_DECODERS)

    def __init__(self) -> None:
        """Begin with the vehicle at the origin and without home."""
        super().__init__()
        self._here = Whereabouts()

    def update(self, position_enu_m: Vector, yaw_rad: float, origin: Geodetic, home: Home | None) -> None:
        """Set the vehicle's position and yaw, and the origin and home that heights and places count from."""
        self._here = Whereabouts(position_enu_m, yaw_rad, origin, home)

    def latest(self, now_us: int, timeout_us: int) -> OffboardSetpoint | None:
        """Return the latest setpoint of the client that is obeyed, if it is no older than `timeout_us`."""
        return self._latest(now_us, timeout_us)

    def _decode(self, message: Message, peer: Peer, now_us: int) -> OffboardSetpoint:
        del peer
        return _DECODERS[message.name](message.fields, self._here, now_us)
