"""Offboard, by velocity: north, east, down, each until it is flown."""

import sys
from math import dist

from mavsdk.plugins.offboard import Offboard, VelocityNedYaw
from mavsdk.plugins.telemetry import Telemetry

from tests.clients.mavsdk_scripts.connection import connected, take_off, until

VELOCITIES_NED_YAW = ((2.0, 0.0, 0.0, 0.0), (0.0, 1.5, 0.0, 90.0), (0.0, 0.0, 0.5, 90.0))


def main(url: str) -> None:
    with connected(url) as vehicle:
        _, telemetry = take_off(vehicle, 5.0)
        offboard = Offboard(vehicle)
        offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 0.0))
        offboard.start()
        for asked in VELOCITIES_NED_YAW:
            offboard.set_velocity_ned(VelocityNedYaw(*asked))
            until(lambda: _off_m_s(telemetry, asked[:3]) < 0.1, "the velocity")  # noqa: B023
        offboard.stop()


def _off_m_s(telemetry: Telemetry, asked: tuple[float, ...]) -> float:
    at = telemetry.position_velocity_ned().velocity
    return dist((at.north_m_s, at.east_m_s, at.down_m_s), asked)


if __name__ == "__main__":
    main(sys.argv[1])
