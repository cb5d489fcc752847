"""Offboard, by velocity ahead and yaw rate: a circle, until it is closed."""

import sys

from mavsdk.plugins.offboard import Offboard, VelocityBodyYawspeed

from tests.clients.mavsdk_scripts.connection import connected, take_off, until

SPEED_M_S, YAW_RATE_DEG_S = 2.0, 45.0
HALVES = (90.0, 270.0)


def main(url: str) -> None:
    with connected(url) as vehicle:
        _, telemetry = take_off(vehicle, 4.0)
        offboard = Offboard(vehicle)
        offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
        offboard.start()
        offboard.set_velocity_body(VelocityBodyYawspeed(SPEED_M_S, 0.0, 0.0, YAW_RATE_DEG_S))
        for heading_deg in (*HALVES, *HALVES):
            until(lambda: abs(telemetry.heading().heading_deg - heading_deg) < 20.0, "a turn")  # noqa: B023
        offboard.stop()


if __name__ == "__main__":
    main(sys.argv[1])
