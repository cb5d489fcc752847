"""Offboard, by attitude and thrust: a roll to the right, to the left, and level again."""

import sys

from mavsdk.plugins.offboard import Attitude, Offboard

from tests.clients.mavsdk_scripts.connection import connected, take_off, until

ROLLS_DEG = (15.0, -15.0, 0.0)
HOVER = 0.34
"""Part of the largest thrust that carries this vehicle."""


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, 10.0)
        offboard = Offboard(vehicle)
        offboard.set_attitude(Attitude(0.0, 0.0, 0.0, HOVER))
        offboard.start()
        for roll_deg in ROLLS_DEG:
            offboard.set_attitude(Attitude(roll_deg, 0.0, 0.0, HOVER))
            until(lambda: abs(telemetry.attitude_euler().roll_deg - roll_deg) < 1.0, "the roll")  # noqa: B023
        offboard.stop()
        action.hold()


if __name__ == "__main__":
    main(sys.argv[1])
