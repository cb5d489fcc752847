"""Every message of telemetry, by name."""

from collections.abc import Callable
from functools import partial

from colibri.mavlink.hil.sensors import OWN_MESSAGES, OwnMessage
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry import attitude, controller, position, power, sensors, status
from colibri.mavlink.telemetry.encoder import Constants, Encoder, fitted
from colibri.mavlink.telemetry.snapshot import Snapshot


def telemetry(constants: Constants | None = None) -> dict[str, Encoder]:
    """Return the encoder of each message, by name, for what does not change in flight.

    An encoder raises nothing, whatever the snapshot holds; its fields fit their types.
    """
    c = Constants() if constants is None else constants
    encoders = {name: encoder for module in _PLAIN for name, encoder in module.items()}
    encoders |= {name: partial(encoder, c=c) for name, encoder in _WITH_CONSTANTS.items()}
    for row in OWN_MESSAGES:
        if row.passed_on:
            encoders[row.message] = _passed_on(row, encoders.get(row.message))
    return {name: fitted(name, encoder) for name, encoder in encoders.items()}


def _passed_on(row: OwnMessage, otherwise: Encoder | None) -> Encoder:
    """Return the encoder of a message as a sensor sent it; `otherwise` where there is no such sensor."""

    def encoder(s: Snapshot) -> Fields | list[Fields] | None:
        value = s.latest.get(row.field)
        if value is not None:
            return row.encoded(value, s.time_us)
        return None if otherwise is None else otherwise(s)

    return encoder


_POSITION: dict[str, Encoder] = {
    "GLOBAL_POSITION_INT": position.global_position_int,
    "LOCAL_POSITION_NED": position.local_position_ned,
    "HOME_POSITION": position.home_position,
    "GPS_GLOBAL_ORIGIN": position.gps_global_origin,
    "GPS_RAW_INT": position.gps_raw_int,
    "ALTITUDE": position.altitude,
    "VFR_HUD": position.vfr_hud,
    "DISTANCE_SENSOR": position.distance_sensor,
    "WIND_COV": position.wind_cov,
}
_ATTITUDE: dict[str, Encoder] = {
    "ATTITUDE": attitude.attitude,
    "ATTITUDE_QUATERNION": attitude.attitude_quaternion,
    "ODOMETRY": attitude.odometry,
    "HIL_STATE_QUATERNION": attitude.hil_state_quaternion,
}
_STATUS: dict[str, Encoder] = {
    "SYS_STATUS": status.sys_status,
    "EXTENDED_SYS_STATE": status.extended_sys_state,
    "CURRENT_MODE": status.current_mode,
    "FLIGHT_INFORMATION": status.flight_information,
    "ESTIMATOR_STATUS": status.estimator_status,
    "SCALED_PRESSURE": sensors.scaled_pressure,
    "VIBRATION": sensors.vibration,
}
_POWER: dict[str, Encoder] = {
    "BATTERY_STATUS": power.battery_status,
    "ESC_STATUS": power.esc_status,
    "ESC_INFO": power.esc_info,
    "SERVO_OUTPUT_RAW": power.servo_output_raw,
    "ACTUATOR_OUTPUT_STATUS": power.actuator_output_status,
    "ACTUATOR_CONTROL_TARGET": power.actuator_control_target,
    "RC_CHANNELS": power.rc_channels,
}
_CONTROLLER: dict[str, Encoder] = {
    "ATTITUDE_TARGET": controller.attitude_target,
    "POSITION_TARGET_LOCAL_NED": controller.position_target_local_ned,
    "POSITION_TARGET_GLOBAL_INT": controller.position_target_global_int,
    "NAV_CONTROLLER_OUTPUT": controller.nav_controller_output,
    "TRAJECTORY_REPRESENTATION_WAYPOINTS": controller.trajectory_representation_waypoints,
    "DEBUG_FLOAT_ARRAY": controller.debug_float_array,
    "NAMED_VALUE_FLOAT": controller.named_value_float,
}
_PLAIN = (_POSITION, _ATTITUDE, _STATUS, _POWER, _CONTROLLER)
_WITH_CONSTANTS: dict[str, Callable[..., Fields | None]] = {
    "SYSTEM_TIME": status.system_time,
    "HIGHRES_IMU": sensors.highres_imu,
    "SCALED_IMU": sensors.scaled_imu,
    "RAW_IMU": sensors.raw_imu,
}
