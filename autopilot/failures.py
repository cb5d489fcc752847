"""Injected failures, MAV_CMD_INJECT_FAILURE: obeyed only where parameter SYS_FAILURE_EN says so, and only what is real.

With GPS off no fix reaches the estimator, and its messages say that there is none. Where the state is told nothing
steers by GPS, and the vehicle flies on as before.
"""

from mavlink.dialect import mav
from mavlink.services.command import DENIED, UNSUPPORTED, Command, Outcome

_GPS: int = mav.FAILURE_UNIT_SENSOR_GPS
_OFF: int = mav.FAILURE_TYPE_OFF
_OK: int = mav.FAILURE_TYPE_OK


class Failures:
    """Which failures are injected.

    Attributes:
        gps_off: Whether there is no GPS.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self.gps_off = False

    def inject(self, command: Command, *, enabled: bool) -> Outcome:
        """Obey a command."""
        if not enabled:
            return Outcome(DENIED, "failure refused: parameter SYS_FAILURE_EN is 0")
        if command.p1 != _GPS or command.p2 not in (_OFF, _OK) or command.p3 not in (0.0, 1.0):
            return Outcome(UNSUPPORTED, "failure refused: only GPS off and ok can be injected")
        self.gps_off = command.p2 == _OFF
        return Outcome()
