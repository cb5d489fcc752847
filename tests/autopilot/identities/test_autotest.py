"""ArduPilot's own tests, as flights of identity `ardupilot` with their criteria.

Each row names the tests of ArduPilot's autotest whose criteria it has (Tools/autotest/arducopter.py and
vehicle_test_suite.py, ArduCopter 4.7.0-dev of July 2025, 90700977); parameters have the names of 4.6.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest

from colibri.sitl.vehicle import Sitl
from tests.autopilot.identities.copter_words import CIRCLE, Check
from tests.autopilot.identities.failsafe_criteria import (
    bad_fences,
    battery_failsafe,
    circle_fence,
    disarming,
    floor_fence,
    gps_glitches,
    height_fence,
    losses_in_spite_of_which_a_mode_continues,
    motor_test,
    radio_failsafe,
    radio_failsafe_without_gps,
    return_at_height,
    return_facing,
    return_to_rally,
    station_failsafe,
    weak_motor,
    without_receiver,
)
from tests.autopilot.identities.flight_criteria import (
    alt_hold,
    brake,
    condition_yaw,
    global_positions,
    guided_submodes,
    guided_thrust,
    landing,
    loiter,
    mission,
    mission_start,
    nav_delay,
    pause_guided,
    pause_mission,
    speed_parameters,
    speeds_in_guided,
    speeds_in_mission,
    takeoff_below,
    takeoff_by_stick,
    takeoff_heights,
    velocities,
    vertical_speed_parameters,
    without_gps,
)
from tests.autopilot.identities.ground_criteria import (
    aux_switches,
    capabilities,
    commands_change_modes,
    fence_by_old_items,
    global_origin,
    index_validity,
    initial_mode,
    jump_tags,
    mission_at_boot,
    mission_start_parameters,
    mode_switch,
    no_arming_without_items,
    no_radio,
    parameter_validation,
    set_home,
)


class Row(NamedTuple):
    """Criteria of ArduPilot's tests; `quick` rows are flown in every run."""

    number: int
    tests: str
    flies: Check
    sets: Mapping[str, float] = MappingProxyType({})
    quick: bool = False
    feedback: str = "state"


ROWS = (
    Row(1, "MAV_CMD_NAV_RETURN_TO_LAUNCH, _LOITER_UNLIM, _VTOL_LAND", commands_change_modes, quick=True),
    Row(2, "GetCapabilities", capabilities, quick=True),
    Row(3, "MissionIndexValidity", index_validity, quick=True),
    Row(4, "InvalidJumpTags", jump_tags, quick=True),
    Row(5, "MAV_CMD_MISSION_START_p1_p2", mission_start_parameters, {"AUTO_OPTIONS": 3}, quick=True),
    Row(6, "NoArmWithoutMissionItems", no_arming_without_items, quick=True),
    Row(7, "ParameterValidation", parameter_validation, quick=True),
    Row(8, "SetHome", set_home),
    Row(
        9,
        "SetModesViaModeSwitch",
        mode_switch,
        {"FLTMODE1": 4, "FLTMODE2": 2, "FLTMODE3": 6, "FLTMODE4": CIRCLE, "FLTMODE5": 0, "FLTMODE6": 17},
    ),
    Row(10, "SetModesViaAuxSwitch", aux_switches, {"FLTMODE4": CIRCLE, "RC9_OPTION": 18, "RC10_OPTION": 55}),
    Row(11, "InitialMode", initial_mode),
    Row(12, "NoRCOnBootPreArmFailure", no_radio, quick=True),
    Row(13, "FenceUpload_MissionItem", fence_by_old_items, {"FENCE_ENABLE": 1, "FENCE_TYPE": 6}, quick=True),
    Row(14, "MISSION_OPTION_CLEAR_MISSION_AT_BOOT", mission_at_boot),
    Row(15, "MAV_CMD_DO_SET_GLOBAL_ORIGIN", global_origin, quick=True),
    Row(16, "MAV_CMD_NAV_TAKEOFF, _command_int", takeoff_heights),
    Row(17, "MAV_CMD_CONDITION_YAW", condition_yaw),
    Row(18, "ModeAltHold", alt_hold),
    Row(19, "ModeLoiter", loiter),
    Row(20, "BrakeMode, BrakeZ", brake),
    Row(21, "PosHoldTakeOff", takeoff_by_stick, {"PILOT_TKOFF_ALT": 700}),
    Row(22, "Landing", landing),
    Row(23, "CopterMission", mission),
    Row(24, "MISSION_START", mission_start),
    Row(25, "NavDelay", nav_delay, {"DISARM_DELAY": 0}),
    Row(26, "TakeoffAlt", takeoff_below),
    Row(27, "PAUSE_CONTINUE", pause_mission, {"AUTO_OPTIONS": 3}),
    Row(28, "PAUSE_CONTINUE_GUIDED", pause_guided, {"GUID_TIMEOUT": 120}),
    Row(29, "DO_CHANGE_SPEED", speeds_in_mission, {"AUTO_OPTIONS": 3}),
    Row(30, "DO_CHANGE_SPEED_in_guided", speeds_in_guided),
    Row(31, "WPNAV_SPEED", speed_parameters),
    Row(31, "WPNAV_SPEED_UP, WPNAV_SPEED_DN", vertical_speed_parameters, {"WPNAV_ACCEL_Z": 400}),
    Row(32, "GuidedSubModeChange", guided_submodes, {"WP_YAW_BEHAVIOR": 0}),
    Row(33, "SetpointGlobalPos", global_positions, {"FS_GCS_ENABLE": 0}),
    Row(34, "SetpointGlobalVel, SetpointBadVel", velocities, {"WPNAV_ACCEL_Z": 250}),
    Row(35, "GuidedModeThrust", guided_thrust, {"GUID_OPTIONS": 8}),
    Row(35, "the climb rate of an attitude's thrust", without_gps),
    Row(36, "WPYawBehaviour1RTL, RTLYaw", return_facing, {"WP_YAW_BEHAVIOR": 1}),
    Row(37, "RTLSpeed, RTL_ALT_FINAL", return_at_height, {"RTL_SPEED": 700, "RTL_ALT_FINAL": 1000}),
    Row(38, "RTL_TO_RALLY", return_to_rally, {"RALLY_INCL_HOME": 0}),
    Row(39, "HorizontalFence", circle_fence, {"FENCE_TYPE": 2, "FENCE_RADIUS": 50}),
    Row(39, "HorizontalFence before arming", bad_fences, quick=True),
    Row(40, "MaxAltFence", height_fence, {"FENCE_TYPE": 1, "FENCE_ALT_MAX": 20}),
    Row(40, "MinAltFence", floor_fence, {"FENCE_TYPE": 8, "FENCE_ALT_MIN": 10}),
    Row(41, "ThrottleFailsafe", radio_failsafe),
    Row(41, "ThrottleFailsafe without GPS", radio_failsafe_without_gps, feedback="sensors"),
    Row(42, "GCSFailsafe", station_failsafe),
    Row(42, "ThrottleFailsafe, GCSFailsafe by FS_OPTIONS", losses_in_spite_of_which_a_mode_continues),
    Row(43, "BatteryFailsafe", battery_failsafe, {"BATT_LOW_VOLT": 11.5, "BATT_CRT_VOLT": 10.1, "BATT_LOW_TIMER": 1}),
    Row(44, "AutoContinueOnRCFailsafe, RCOverridesNoRCReceiver", without_receiver, {"FS_OPTIONS": 5}),
    Row(45, "StabilityPatch", weak_motor),
    Row(45, "GPSGlitchLoiter", gps_glitches, feedback="sensors"),
    Row(46, "RudderDisarmMidair, MAV_CMD_DO_FLIGHTTERMINATION", disarming),
    Row(46, "MotorTest", motor_test, quick=True),
)


def _marked(row: Row) -> Any:
    marks = [pytest.mark.sitl(identity="ardupilot", feedback=row.feedback, params=dict(row.sets))]
    return pytest.param(
        row.flies, id=f"{row.number}-{row.flies.__name__}", marks=[*marks, *([] if row.quick else [pytest.mark.long])]
    )


@pytest.mark.parametrize("flies", [*map(_marked, ROWS)])
def test_criteria_of_ardupilots_own_tests(sitl: Sitl, flies: Check) -> None:
    flies(sitl)
