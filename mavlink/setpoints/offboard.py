"""The offboard microservice: setpoints that a client streams.

Specification: https://mavlink.io/en/services/offboard_control.html. Setpoints are never answered. One that cannot be
flown is dropped and counted, and keeps no stream alive. SET_ACTUATOR_CONTROL_TARGET is accepted and never flown: nobody
but the control law commands rotors.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from colibri.common.earth.geodesy import Geodetic
from colibri.common.types import Vector
from colibri.mavlink.node.service import Peer, Send
from colibri.mavlink.setpoints.arbitration import SILENT_AFTER_US, Streams
from colibri.mavlink.setpoints.decoding import Refused, Whereabouts, decode_attitude, decode_global, decode_local
from colibri.mavlink.setpoints.setpoints import OffboardSetpoint
from colibri.mavlink.telemetry.snapshot import Home
from colibri.mavlink.wire.dialect import Message

_DECODERS: dict[str, Callable[[Any, Whereabouts, int], OffboardSetpoint]] = {
    "SET_POSITION_TARGET_LOCAL_NED": decode_local,
    "SET_POSITION_TARGET_GLOBAL_INT": decode_global,
    "SET_ATTITUDE_TARGET": decode_attitude,
}


class Offboard:
    """Keeps the latest setpoint of the client that is obeyed; see `streams` for which that is.

    Attributes:
        handles: The messages of setpoints.
        dropped: Setpoints that were not taken, by reason.
        ignored: How many SET_ACTUATOR_CONTROL_TARGET came.
    """

    handles = frozenset({*_DECODERS, "SET_ACTUATOR_CONTROL_TARGET"})

    def __init__(self) -> None:
        """Nobody streams yet; the vehicle is at the origin and has no home."""
        self.dropped: Counter[str] = Counter()
        self.ignored = 0
        self._streams: Streams[OffboardSetpoint] = Streams()
        self._here = Whereabouts()

    @property
    def source(self) -> Peer | None:
        """The client that is obeyed; None before the first setpoint."""
        return self._streams.source

    def update(self, position_enu_m: Vector, yaw_rad: float, origin: Geodetic, home: Home | None) -> None:
        """Know where the vehicle is, which way it looks, and where heights and places count from."""
        self._here = Whereabouts(position_enu_m, yaw_rad, origin, home)

    def receive(self, message: Message, peer: Peer, now_us: int) -> Iterable[Send]:
        """Take in a setpoint; there is never an answer."""
        decode = _DECODERS.get(message.name)
        if decode is None:
            self.ignored += 1
            return ()
        try:
            setpoint = decode(message.fields, self._here, now_us)
        except Refused as refused:
            self.dropped[str(refused)] += 1
            return ()
        if not self._streams.hear(peer, setpoint, now_us):
            self.dropped["another client"] += 1
        return ()

    def poll(self, now_us: int) -> Iterable[Send]:
        """Nothing is ever due."""
        del now_us
        return ()

    def engage(self, peer: Peer, now_us: int) -> None:
        """Obey `peer`, who has just asked for the mode, rather than another that streams too."""
        self._streams.claim(peer, now_us)

    def is_streaming(self, now_us: int) -> bool:
        """Whether there is a setpoint to begin the mode with: one of the last 0.5 s."""
        return self._streams.latest(now_us, SILENT_AFTER_US) is not None

    def latest(self, now_us: int, timeout_us: int) -> OffboardSetpoint | None:
        """Return the latest setpoint of the client that is obeyed, if it is no older than `timeout_us`."""
        heard = self._streams.latest(now_us, timeout_us)
        return heard.value if heard else None
