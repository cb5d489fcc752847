"""Sticks: ahead for 5 m, then let go; then a turn."""

import sys
from threading import Event, Thread

from mavsdk.plugins.manual_control import ManualControl

from tests.clients.mavsdk_scripts.connection import connected, take_off, until

AHEAD_M = 5.0
_EVERY_S = 0.03


class Sticks:
    """Held until they are moved: sent again and again, as a joystick does."""

    def __init__(self, manual: ManualControl) -> None:
        self.held = (0.0, 0.0, 0.5, 0.0)
        self._manual = manual
        manual.set_manual_control_input(*self.held)
        self._dropped = Event()
        self._thread = Thread(target=self._send)
        self._thread.start()

    def _send(self) -> None:
        while not self._dropped.wait(_EVERY_S):
            self._manual.set_manual_control_input(*self.held)

    def drop(self) -> None:
        self._dropped.set()
        self._thread.join()


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, 4.0)
        manual = ManualControl(vehicle)
        sticks = Sticks(manual)
        try:
            manual.start_position_control()
            sticks.held = (0.5, 0.0, 0.5, 0.0)
            until(lambda: telemetry.position_velocity_ned().position.north_m > AHEAD_M, "5 m ahead")
            sticks.held = (0.0, 0.0, 0.5, 0.0)
            until(lambda: abs(telemetry.position_velocity_ned().velocity.north_m_s) < 0.05, "a stop")
            sticks.held = (0.0, 0.0, 0.5, 0.5)
            until(lambda: 60.0 < telemetry.heading().heading_deg < 120.0, "a turn to the right")
        finally:
            sticks.drop()
        action.hold()


if __name__ == "__main__":
    main(sys.argv[1])
