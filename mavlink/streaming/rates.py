"""How often each message is streamed where nobody has asked for another rate."""

HZ = 1_000_000

SDK = "sdk"
GCS = "gcs"
SILENT = "silent"

_SDK_HZ = {
    "ATTITUDE": 100.0,
    "GLOBAL_POSITION_INT": 50.0,
    "HIGHRES_IMU": 50.0,
    "ATTITUDE_QUATERNION": 50.0,
    "LOCAL_POSITION_NED": 30.0,
    "ODOMETRY": 30.0,
    "ATTITUDE_TARGET": 10.0,
    "POSITION_TARGET_LOCAL_NED": 10.0,
    "SERVO_OUTPUT_RAW": 10.0,
    "VFR_HUD": 10.0,
    "ALTITUDE": 10.0,
    "HIL_STATE_QUATERNION": 10.0,
    "GPS_RAW_INT": 8.0,
    "SYS_STATUS": 5.0,
    "EXTENDED_SYS_STATE": 5.0,
    "DISTANCE_SENSOR": 5.0,
    "POSITION_TARGET_GLOBAL_INT": 1.0,
    "BATTERY_STATUS": 1.0,
    "SYSTEM_TIME": 1.0,
    "HOME_POSITION": 0.5,
    "GPS_GLOBAL_ORIGIN": 0.5,
    "CURRENT_MODE": 0.5,
    "FLIGHT_INFORMATION": 0.5,
    "ESTIMATOR_STATUS": 1.0,
    "WIND_COV": 1.0,
    "RC_CHANNELS": 1.0,
    "SCALED_IMU": 1.0,
    "RAW_IMU": 1.0,
    "SCALED_PRESSURE": 1.0,
    "VIBRATION": 0.5,
    "NAV_CONTROLLER_OUTPUT": 1.0,
    "ACTUATOR_OUTPUT_STATUS": 1.0,
    "ACTUATOR_CONTROL_TARGET": 1.0,
    "ESC_STATUS": 1.0,
    "ESC_INFO": 0.5,
    "TRAJECTORY_REPRESENTATION_WAYPOINTS": 1.0,
    "DEBUG_FLOAT_ARRAY": 1.0,
    "NAMED_VALUE_FLOAT": 1.0,
}
"""PX4's on its port for SDKs, measured; the simulator's truth at 10 Hz; the controller once a second. SDKs ask for
nothing: what they can show must come on its own."""

_GCS_HZ = {
    "ATTITUDE": 10.0,
    "ATTITUDE_QUATERNION": 5.0,
    "GLOBAL_POSITION_INT": 5.0,
    "LOCAL_POSITION_NED": 5.0,
    "VFR_HUD": 4.0,
    "GPS_RAW_INT": 2.0,
    "ALTITUDE": 2.0,
    "ATTITUDE_TARGET": 2.0,
    "POSITION_TARGET_LOCAL_NED": 2.0,
    "POSITION_TARGET_GLOBAL_INT": 2.0,
    "NAV_CONTROLLER_OUTPUT": 2.0,
    "EXTENDED_SYS_STATE": 2.0,
    "SYS_STATUS": 1.0,
    "BATTERY_STATUS": 1.0,
    "SYSTEM_TIME": 1.0,
    "SERVO_OUTPUT_RAW": 1.0,
    "RC_CHANNELS": 1.0,
    "ESC_STATUS": 1.0,
    "HIGHRES_IMU": 1.0,
    "SCALED_PRESSURE": 1.0,
    "TRAJECTORY_REPRESENTATION_WAYPOINTS": 1.0,
    "DEBUG_FLOAT_ARRAY": 1.0,
    "NAMED_VALUE_FLOAT": 1.0,
    "HOME_POSITION": 0.5,
    "GPS_GLOBAL_ORIGIN": 0.2,
    "CURRENT_MODE": 0.5,
    "ESTIMATOR_STATUS": 0.5,
    "WIND_COV": 0.5,
    "VIBRATION": 0.5,
    "ESC_INFO": 0.2,
}
"""What a ground station shows, at rates that an eye can follow and a radio could carry."""


def _intervals(rates_hz: dict[str, float]) -> dict[str, int]:
    return {name: round(HZ / rate) for name, rate in rates_hz.items()}


DEFAULTS: dict[str, dict[str, int]] = {SDK: _intervals(_SDK_HZ), GCS: _intervals(_GCS_HZ), SILENT: {}}
"""Interval of each message, µs, by the kind of channel."""

GROUPS: dict[int, tuple[str, ...]] = {
    1: ("RAW_IMU", "SCALED_IMU", "SCALED_PRESSURE", "HIGHRES_IMU"),
    2: ("SYS_STATUS", "GPS_RAW_INT", "NAV_CONTROLLER_OUTPUT", "BATTERY_STATUS", "EXTENDED_SYS_STATE"),
    3: ("RC_CHANNELS", "SERVO_OUTPUT_RAW"),
    4: ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "ACTUATOR_CONTROL_TARGET"),
    6: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    10: ("ATTITUDE", "ATTITUDE_QUATERNION"),
    11: ("VFR_HUD", "ALTITUDE"),
    12: ("SYSTEM_TIME", "ESTIMATOR_STATUS", "WIND_COV", "VIBRATION", "DISTANCE_SENSOR", "ESC_STATUS"),
}
"""The messages of each MAV_DATA_STREAM, as ArduPilot groups them: raw sensors, extended status, radio channels, raw
controller, position, extra 1 to 3. MAV_DATA_STREAM_ALL (0) means all groups."""
ALL_GROUPS = tuple(name for names in GROUPS.values() for name in names)
