"""Follow-me: behind a target that stands, then one that has moved."""

import sys

from mavsdk.plugins.follow_me import Config, FollowMe, TargetLocation

from tests.clients.mavsdk_scripts.connection import connected, distance_m, place, take_off, until

DISTANCE_M, HEIGHT_M = 4.0, 8.0
TARGETS_NORTH_EAST_M = ((10.0, 0.0), (10.0, 15.0))


def main(url: str) -> None:
    with connected(url) as vehicle:
        _, telemetry = take_off(vehicle, 4.0)
        follow_me = FollowMe(vehicle)
        follow_me.set_config(Config(HEIGHT_M, DISTANCE_M, 0.5, Config.FollowAltitudeMode.CONSTANT, 8.0, 180.0))
        follow_me.start()
        until(follow_me.is_active, "follow-me")
        for north_m, east_m in TARGETS_NORTH_EAST_M:
            latitude, longitude = place(telemetry, north_m, east_m)
            follow_me.set_target_location(TargetLocation(latitude, longitude, 488.0, 0.0, 0.0, 0.0))
            until(lambda: abs(distance_m(telemetry, north_m, east_m, -HEIGHT_M) - DISTANCE_M) < 0.2, "the target")  # noqa: B023
        follow_me.stop()


if __name__ == "__main__":
    main(sys.argv[1])
