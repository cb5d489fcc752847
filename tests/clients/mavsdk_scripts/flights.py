"""Flights by the action, mission, follow-me and manual-control plugins."""

from math import nan
from threading import Event, Thread
from typing import Any

from mavsdk.plugins.action import Action, ActionResult, OrbitYawBehavior
from mavsdk.plugins.calibration import Calibration, CalibrationResult
from mavsdk.plugins.follow_me import Config, FollowMe, TargetLocation
from mavsdk.plugins.manual_control import ManualControl
from mavsdk.plugins.mission import Mission, MissionItem, MissionPlan
from mavsdk.plugins.telemetry import FlightMode, Telemetry

from tests.clients.mavsdk_scripts.connection import distance_m, place, refused, take_off, until

TAKEOFF_M = 5.0
GOTO_NORTH_EAST_UP_M, GOTO_HEADING_DEG = (15.0, -10.0, 8.0), 90.0
ORBIT_NORTH_EAST_UP_M, ORBIT_RADIUS_M, ORBIT_SPEED_M_S = (5.0, 0.0, 6.0), 5.0, 2.0
MISSION_NORTH_EAST_M, MISSION_HEIGHT_M, MISSION_SPEED_M_S = ((10.0, 0.0), (10.0, 10.0), (0.0, 10.0)), 6.0, 4.0
TARGETS_NORTH_EAST_M, FOLLOWS_AT_M, FOLLOWS_UP_M = ((10.0, 0.0), (10.0, 15.0)), 4.0, 8.0


def takeoff_and_land(vehicle: Any) -> None:
    action, telemetry = take_off(vehicle, TAKEOFF_M)
    assert telemetry.in_air()
    action.land()
    until(lambda: not telemetry.armed(), "the rotors to stop")
    assert not telemetry.in_air()


def generic(vehicle: Any) -> None:
    """Fly a vehicle that says it is no PX4: what MAVSDK then does not ask for."""
    action, telemetry = take_off(vehicle, 3.0)
    refused(action.get_return_to_launch_altitude, ActionResult.UNSUPPORTED)
    refusals: list[object] = []
    Calibration(vehicle).calibrate_gyro_async(lambda result, *_: refusals.append(result))
    until(lambda: refusals, "a word on the calibration")
    assert refusals == [CalibrationResult.UNSUPPORTED], refusals
    action.return_to_launch()
    until(lambda: telemetry.flight_mode() == FlightMode.RETURN_TO_LAUNCH, "the return")
    until(lambda: not telemetry.armed(), "the rotors to stop")


def goto(vehicle: Any) -> None:
    action, telemetry = take_off(vehicle, 3.0)
    north_m, east_m, up_m = GOTO_NORTH_EAST_UP_M
    altitude_m = telemetry.home().absolute_altitude_m + up_m
    action.goto_location(*place(telemetry, north_m, east_m), altitude_m, GOTO_HEADING_DEG)
    until(lambda: distance_m(telemetry, north_m, east_m, -up_m) < 0.3, "the place")
    until(lambda: abs(telemetry.heading().heading_deg - GOTO_HEADING_DEG) < 3.0, "the heading")
    action.set_return_to_launch_altitude(6.0)
    action.return_to_launch()
    until(lambda: not telemetry.armed(), "the rotors to stop")


def orbit(vehicle: Any) -> None:
    """Begin a circle; the vehicle goes on when the script has ended."""
    action, telemetry = take_off(vehicle, 4.0)
    north_m, east_m, up_m = ORBIT_NORTH_EAST_UP_M
    altitude_m = telemetry.home().absolute_altitude_m + up_m
    inwards = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    action.do_orbit(ORBIT_RADIUS_M, ORBIT_SPEED_M_S, inwards, *place(telemetry, north_m, east_m), altitude_m)


def mission(vehicle: Any) -> None:
    """Fly to three places, then home by itself; the mission is downloaded, and interrupted on the way."""
    mission, action, telemetry = Mission(vehicle), Action(vehicle), Telemetry(vehicle)
    until(lambda: telemetry.health().is_armable and telemetry.health().is_home_position_ok, "a vehicle to arm")
    items = [_item(*place(telemetry, *there)) for there in MISSION_NORTH_EAST_M]
    mission.set_return_to_launch_after_mission(True)
    mission.upload_mission(MissionPlan(items))
    assert len(mission.download_mission().mission_items) == len(items)
    action.set_return_to_launch_altitude(MISSION_HEIGHT_M)
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
        relative_altitude_m=MISSION_HEIGHT_M,
        speed_m_s=MISSION_SPEED_M_S,
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


def follow_me(vehicle: Any) -> None:
    """Follow a target that stands, then one that has moved."""
    _, telemetry = take_off(vehicle, 4.0)
    follow_me = FollowMe(vehicle)
    follow_me.set_config(Config(FOLLOWS_UP_M, FOLLOWS_AT_M, 0.5, Config.FollowAltitudeMode.CONSTANT, 8.0, 180.0))
    follow_me.start()
    until(follow_me.is_active, "follow-me")
    for north_m, east_m in TARGETS_NORTH_EAST_M:
        latitude, longitude = place(telemetry, north_m, east_m)
        follow_me.set_target_location(TargetLocation(latitude, longitude, 488.0, 0.0, 0.0, 0.0))
        until(lambda: abs(distance_m(telemetry, north_m, east_m, -FOLLOWS_UP_M) - FOLLOWS_AT_M) < 0.2, "the target")  # noqa: B023
    follow_me.stop()


class Sticks:
    """Held until they are moved: sent again and again, as a joystick does."""

    def __init__(self, manual: ManualControl) -> None:
        self.held = (0.0, 0.0, 0.5, 0.0)
        self._manual = manual
        manual.set_manual_control_input(*self.held)
        self._dropped = Event()
        self._thread = Thread(target=self._send)
        self._thread.start()

    def _send(self) -> None:
        while not self._dropped.wait(0.03):
            self._manual.set_manual_control_input(*self.held)

    def drop(self) -> None:
        self._dropped.set()
        self._thread.join()


def manual_control(vehicle: Any) -> None:
    """Go ahead for 5 m, then let go; then turn."""
    action, telemetry = take_off(vehicle, 4.0)
    manual = ManualControl(vehicle)
    sticks = Sticks(manual)
    try:
        manual.start_position_control()
        sticks.held = (0.5, 0.0, 0.5, 0.0)
        until(lambda: telemetry.position_velocity_ned().position.north_m > 5.0, "5 m ahead")
        sticks.held = (0.0, 0.0, 0.5, 0.0)
        until(lambda: abs(telemetry.position_velocity_ned().velocity.north_m_s) < 0.05, "a stop")
        sticks.held = (0.0, 0.0, 0.5, 0.5)
        until(lambda: 60.0 < telemetry.heading().heading_deg < 120.0, "a turn to the right")
    finally:
        sticks.drop()
    action.hold()
