"""Offboard, by position: two places, then stop."""

import sys

from mavsdk.plugins.offboard import Offboard, PositionNedYaw

from tests.clients.mavsdk_scripts.connection import connected, distance_m, take_off, until

PLACES_NED_YAW = ((4.0, 0.0, -4.0, 90.0), (0.0, 3.0, -6.0, 0.0))


def main(url: str) -> None:
    with connected(url) as vehicle:
        _, telemetry = take_off(vehicle, 3.0)
        offboard = Offboard(vehicle)
        offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -3.0, 0.0))
        offboard.start()
        for north_m, east_m, down_m, yaw_deg in PLACES_NED_YAW:
            offboard.set_position_ned(PositionNedYaw(north_m, east_m, down_m, yaw_deg))
            until(lambda: distance_m(telemetry, north_m, east_m, down_m) < 0.1, "the place")  # noqa: B023
        assert offboard.is_active()
        offboard.stop()


if __name__ == "__main__":
    main(sys.argv[1])
