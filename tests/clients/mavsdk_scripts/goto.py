"""To a place, and home again."""

import sys

from tests.clients.mavsdk_scripts.connection import connected, distance_m, place, take_off, until

NORTH_M, EAST_M, HEIGHT_M, HEADING_DEG = 15.0, -10.0, 8.0, 90.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, 3.0)
        altitude_m = telemetry.home().absolute_altitude_m + HEIGHT_M
        action.goto_location(*place(telemetry, NORTH_M, EAST_M), altitude_m, HEADING_DEG)
        until(lambda: distance_m(telemetry, NORTH_M, EAST_M, -HEIGHT_M) < 0.3, "the place")
        until(lambda: abs(telemetry.heading().heading_deg - HEADING_DEG) < 3.0, "the heading")
        action.set_return_to_launch_altitude(6.0)
        action.return_to_launch()
        until(lambda: not telemetry.armed(), "the rotors to stop")


if __name__ == "__main__":
    main(sys.argv[1])
