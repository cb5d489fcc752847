"""Up to 5 m, and down again."""

import sys

from tests.clients.mavsdk_scripts.connection import connected, take_off, until

HEIGHT_M = 5.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        action, telemetry = take_off(vehicle, HEIGHT_M)
        assert telemetry.in_air()
        action.land()
        until(lambda: not telemetry.armed(), "the rotors to stop")
        assert not telemetry.in_air()


if __name__ == "__main__":
    main(sys.argv[1])
