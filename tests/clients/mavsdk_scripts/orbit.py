"""Around a place; the vehicle goes on when the script has ended."""

import sys

from mavsdk.plugins.action import OrbitYawBehavior

from tests.clients.mavsdk_scripts.connection import connected, place, take_off

RADIUS_M, SPEED_M_S, HEIGHT_M, NORTH_M, EAST_M = 5.0, 2.0, 6.0, 5.0, 0.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, 4.0)
        altitude_m = telemetry.home().absolute_altitude_m + HEIGHT_M
        inwards = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
        action.do_orbit(RADIUS_M, SPEED_M_S, inwards, *place(telemetry, NORTH_M, EAST_M), altitude_m)


if __name__ == "__main__":
    main(sys.argv[1])
