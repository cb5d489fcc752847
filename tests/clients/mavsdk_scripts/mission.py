"""Three places, then home by itself; downloaded, interrupted and gone on with on the way."""

import sys
from math import nan

from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.telemetry import FlightMode, Telemetry

from tests.clients.mavsdk_scripts.connection import connected, place, until

PLACES_NORTH_EAST_M = ((10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
HEIGHT_M, SPEED_M_S = 6.0, 4.0


def main(url: str) -> None:
    with connected(url) as vehicle:
        mission, action, telemetry = Mission(vehicle), Action(vehicle), Telemetry(vehicle)
        until(lambda: telemetry.health().is_armable and telemetry.health().is_home_position_ok, "a vehicle to arm")
        items = [_item(*place(telemetry, *there)) for there in PLACES_NORTH_EAST_M]
        mission.set_return_to_launch_after_mission(True)
        mission.upload_mission(MissionPlan(items))
        assert len(mission.download_mission().mission_items) == len(items)
        action.set_return_to_launch_altitude(HEIGHT_M)
        action.arm()
        mission.start_mission()
        until(lambda: mission.mission_progress().current == 1, "the first place")
        mission.pause_mission()
        until(lambda: telemetry.flight_mode() == FlightMode.HOLD, "the pause")
        mission.start_mission()
        until(lambda: telemetry.flight_mode() == FlightMode.RETURN_TO_LAUNCH, "the way home")
        until(lambda: not telemetry.armed(), "the rotors to stop")
        progress = mission.mission_progress()
        assert progress.current == progress.total, (progress.current, progress.total)


def _item(latitude_deg: float, longitude_deg: float) -> MissionItem:
    return MissionItem(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        relative_altitude_m=HEIGHT_M,
        speed_m_s=SPEED_M_S,
        is_fly_through=False,
        gimbal_pitch_deg=nan,
        gimbal_yaw_deg=nan,
        camera_action=MissionItem.CameraAction.NONE,
        loiter_time_s=nan,
        camera_photo_interval_s=nan,
        acceptance_radius_m=0.5,
        yaw_deg=nan,
        camera_photo_distance_m=nan,
        vehicle_action=MissionItem.VehicleAction.NONE,
    )


if __name__ == "__main__":
    main(sys.argv[1])
