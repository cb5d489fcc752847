"""Offboard by position, velocity, velocity along the body, and attitude: each until it is flown, then stop."""

from math import dist
from typing import Any

from mavsdk.plugins.offboard import Attitude, Offboard, PositionNedYaw, VelocityBodyYawspeed, VelocityNedYaw

from tests.clients.mavsdk_scripts.connection import distance_m, take_off, until

PLACES_NED_YAW = ((4.0, 0.0, -4.0, 90.0), (0.0, 3.0, -6.0, 0.0))
VELOCITIES_NED_YAW = ((2.0, 0.0, 0.0, 0.0), (0.0, 1.5, 0.0, 90.0), (0.0, 0.0, 0.5, 90.0))
SPEED_M_S, YAW_RATE_DEG_S = 2.0, 45.0
ROLLS_DEG = (15.0, -15.0, 0.0)
HOVER = 0.34  # part of the largest thrust that carries this vehicle


def position(vehicle: Any) -> None:
    _, telemetry = take_off(vehicle, 3.0)
    offboard = Offboard(vehicle)
    offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -3.0, 0.0))
    offboard.start()
    for north_m, east_m, down_m, yaw_deg in PLACES_NED_YAW:
        offboard.set_position_ned(PositionNedYaw(north_m, east_m, down_m, yaw_deg))
        until(lambda: distance_m(telemetry, north_m, east_m, down_m) < 0.1, "the place")  # noqa: B023
    assert offboard.is_active()
    offboard.stop()


def velocity(vehicle: Any) -> None:
    _, telemetry = take_off(vehicle, 5.0)
    offboard = Offboard(vehicle)
    offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 0.0))
    offboard.start()

    def off_m_s(asked: tuple[float, ...]) -> float:
        at = telemetry.position_velocity_ned().velocity
        return dist((at.north_m_s, at.east_m_s, at.down_m_s), asked)

    for asked in VELOCITIES_NED_YAW:
        offboard.set_velocity_ned(VelocityNedYaw(*asked))
        until(lambda: off_m_s(asked[:3]) < 0.1, "the velocity")  # noqa: B023
    offboard.stop()


def body(vehicle: Any) -> None:
    """Fly a circle, until it is closed."""
    _, telemetry = take_off(vehicle, 4.0)
    offboard = Offboard(vehicle)
    offboard.set_velocity_body(VelocityBodyYawspeed(0.0, 0.0, 0.0, 0.0))
    offboard.start()
    offboard.set_velocity_body(VelocityBodyYawspeed(SPEED_M_S, 0.0, 0.0, YAW_RATE_DEG_S))
    for heading_deg in (90.0, 270.0, 90.0, 270.0):
        until(lambda: abs(telemetry.heading().heading_deg - heading_deg) < 20.0, "a turn")  # noqa: B023
    offboard.stop()


def attitude(vehicle: Any) -> None:
    action, telemetry = take_off(vehicle, 10.0)
    offboard = Offboard(vehicle)
    offboard.set_attitude(Attitude(0.0, 0.0, 0.0, HOVER))
    offboard.start()
    for roll_deg in ROLLS_DEG:
        offboard.set_attitude(Attitude(roll_deg, 0.0, 0.0, HOVER))
        until(lambda: abs(telemetry.attitude_euler().roll_deg - roll_deg) < 1.0, "the roll")  # noqa: B023
    offboard.stop()
    action.hold()
