"""ArduPilot's own tests, as flights of identity `ardupilot` with their criteria.

Each row names the tests of ArduPilot's autotest whose criteria it has (Tools/autotest/arducopter.py and
vehicle_test_suite.py, ArduCopter 4.7.0-dev of July 2025, 90700977); parameters have the names of 4.6.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest

from colibri.sitl.vehicle import Sitl
from tests.autopilot.identities import failsafe_criteria as failsafes
from tests.autopilot.identities import flight_criteria as flights
from tests.autopilot.identities import ground_criteria as ground
from tests.autopilot.identities.copter_words import CIRCLE, Check


class Row(NamedTuple):
    """Criteria of ArduPilot's tests; `quick` rows are flown in every run."""

    number: int
    tests: str
    flies: Check
    sets: Mapping[str, float] = MappingProxyType({})
    quick: bool = False
    feedback: str = "state"


ROWS = (
    Row(1, "MAV_CMD_NAV_RETURN_TO_LAUNCH, _LOITER_UNLIM, _VTOL_LAND", ground.commands_change_modes, quick=True),
    Row(2, "GetCapabilities", ground.capabilities, quick=True),
    Row(3, "MissionIndexValidity", ground.index_validity, quick=True),
    Row(4, "InvalidJumpTags", ground.jump_tags, quick=True),
    Row(5, "MAV_CMD_MISSION_START_p1_p2", ground.mission_start_parameters, {"AUTO_OPTIONS": 3}, quick=True),
    Row(6, "NoArmWithoutMissionItems", ground.no_arming_without_items, quick=True),
    Row(7, "ParameterValidation", ground.parameter_validation, quick=True),
    Row(8, "SetHome", ground.set_home),
    Row(
        9,
        "SetModesViaModeSwitch",
        ground.mode_switch,
        {"FLTMODE1": 4, "FLTMODE2": 2, "FLTMODE3": 6, "FLTMODE4": CIRCLE, "FLTMODE5": 0, "FLTMODE6": 17},
    ),
    Row(10, "SetModesViaAuxSwitch", ground.aux_switches, {"FLTMODE4": CIRCLE, "RC9_OPTION": 18, "RC10_OPTION": 55}),
    Row(11, "InitialMode", ground.initial_mode),
    Row(12, "NoRCOnBootPreArmFailure", ground.no_radio, quick=True),
    Row(13, "FenceUpload_MissionItem", ground.fence_by_old_items, {"FENCE_ENABLE": 1, "FENCE_TYPE": 6}, quick=True),
    Row(14, "MISSION_OPTION_CLEAR_MISSION_AT_BOOT", ground.mission_at_boot),
    Row(15, "MAV_CMD_DO_SET_GLOBAL_ORIGIN", ground.global_origin, quick=True),
    Row(16, "MAV_CMD_NAV_TAKEOFF, _command_int", flights.takeoff_heights),
    Row(17, "MAV_CMD_CONDITION_YAW", flights.condition_yaw),
    Row(18, "ModeAltHold", flights.alt_hold),
    Row(19, "ModeLoiter", flights.loiter),
    Row(20, "BrakeMode, BrakeZ", flights.brake),
    Row(21, "PosHoldTakeOff", flights.takeoff_by_stick, {"PILOT_TKOFF_ALT": 700}),
    Row(22, "Landing", flights.landing),
    Row(23, "CopterMission", flights.mission),
    Row(24, "MISSION_START", flights.mission_start),
    Row(25, "NavDelay", flights.nav_delay, {"DISARM_DELAY": 0}),
    Row(26, "TakeoffAlt", flights.takeoff_below),
    Row(27, "PAUSE_CONTINUE", flights.pause_mission, {"AUTO_OPTIONS": 3}),
    Row(28, "PAUSE_CONTINUE_GUIDED", flights.pause_guided, {"GUID_TIMEOUT": 120}),
    Row(29, "DO_CHANGE_SPEED", flights.speeds_in_mission, {"AUTO_OPTIONS": 3}),
    Row(30, "DO_CHANGE_SPEED_in_guided", flights.speeds_in_guided),
    Row(31, "WPNAV_SPEED", flights.speed_parameters),
    Row(31, "WPNAV_SPEED_UP, WPNAV_SPEED_DN", flights.vertical_speed_parameters, {"WPNAV_ACCEL_Z": 400}),
    Row(32, "GuidedSubModeChange", flights.guided_submodes, {"WP_YAW_BEHAVIOR": 0}),
    Row(33, "SetpointGlobalPos", flights.global_positions, {"FS_GCS_ENABLE": 0}),
    Row(34, "SetpointGlobalVel, SetpointBadVel", flights.velocities, {"WPNAV_ACCEL_Z": 250}),
    Row(35, "GuidedModeThrust", flights.guided_thrust, {"GUID_OPTIONS": 8}),
    Row(35, "the climb rate of an attitude's thrust", flights.without_gps),
    Row(36, "WPYawBehaviour1RTL, RTLYaw", failsafes.return_facing, {"WP_YAW_BEHAVIOR": 1}),
    Row(37, "RTLSpeed, RTL_ALT_FINAL", failsafes.return_at_height, {"RTL_SPEED": 700, "RTL_ALT_FINAL": 1000}),
    Row(38, "RTL_TO_RALLY", failsafes.return_to_rally, {"RALLY_INCL_HOME": 0}),
    Row(39, "HorizontalFence", failsafes.circle_fence, {"FENCE_TYPE": 2, "FENCE_RADIUS": 50}),
    Row(39, "HorizontalFence before arming", failsafes.bad_fences, quick=True),
    Row(40, "MaxAltFence", failsafes.height_fence, {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 20}),
    Row(40, "MinAltFence", failsafes.floor_fence, {"FENCE_TYPE": 8, "FENCE_ALT_MIN": 10}),
    Row(41, "ThrottleFailsafe", failsafes.radio_failsafe),
    Row(41, "ThrottleFailsafe without GPS", failsafes.radio_failsafe_without_gps, feedback="sensors"),
    Row(42, "GCSFailsafe", failsafes.station_failsafe),
    Row(42, "ThrottleFailsafe, GCSFailsafe by FS_OPTIONS", failsafes.losses_in_spite_of_which_a_mode_continues),
    Row(43, "BatteryFailsafe", failsafes.battery, {"BATT_LOW_VOLT": 11.5, "BATT_CRT_VOLT": 10.1, "BATT_LOW_TIMER": 1}),
    Row(44, "AutoContinueOnRCFailsafe, RCOverridesNoRCReceiver", failsafes.without_receiver, {"FS_OPTIONS": 5}),
    Row(45, "StabilityPatch", failsafes.weak_motor),
    Row(45, "GPSGlitchLoiter", failsafes.gps_glitches, feedback="sensors"),
    Row(46, "RudderDisarmMidair, MAV_CMD_DO_FLIGHTTERMINATION", failsafes.disarming),
    Row(46, "MotorTest", failsafes.motor_test, quick=True),
)


def _marked(row: Row) -> Any:
    marks = [pytest.mark.sitl(identity="ardupilot", feedback=row.feedback, params=dict(row.sets))]
    return pytest.param(
        row.flies, id=f"{row.number}-{row.flies.__name__}", marks=[*marks, *([] if row.quick else [pytest.mark.long])]
    )


@pytest.mark.parametrize("flies", [*map(_marked, ROWS)])
def test_criteria_of_ardupilots_own_tests(sitl: Sitl, flies: Check) -> None:
    flies(sitl)
