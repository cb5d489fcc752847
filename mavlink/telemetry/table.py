"""All telemetry messages by name."""

from functools import partial

from colibri.mavlink.hil.sensors import OWN_MESSAGES, OwnMessage
from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry import attitude, controller, position, power, sensors, status
from colibri.mavlink.telemetry.encoder import Encoder, fitted
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot


def telemetry(boot_unix_us: int = 0) -> dict[str, Encoder]:
    """Return the encoder of each message by name; an encoder never raises."""
    encoders: dict[str, Encoder] = {encoder.__name__.upper(): encoder for encoder in _ENCODERS}
    encoders["SYSTEM_TIME"] = partial(status.system_time, boot_unix_us=boot_unix_us)
    for row in OWN_MESSAGES:
        if row.passed_on:
            encoders[row.message] = _passed_on(row, encoders.get(row.message))
    return {name: fitted(name, encoder) for name, encoder in encoders.items()}


def _passed_on(row: OwnMessage, otherwise: Encoder | None) -> Encoder:

    def encoder(s: TelemetrySnapshot) -> Fields | list[Fields] | None:
        value = s.latest.get(row.field)
        if value is not None:
            return row.encoded(value, s.time_us)
        return None if otherwise is None else otherwise(s)

    return encoder


_ENCODERS: tuple[Encoder, ...] = (
    *(position.global_position_int, position.local_position_ned, position.home_position, position.gps_global_origin),
    *(position.gps_raw_int, position.altitude, position.vfr_hud, position.distance_sensor, position.wind_cov),
    *(attitude.attitude, attitude.attitude_quaternion, attitude.odometry, attitude.hil_state_quaternion),
    *(status.sys_status, status.extended_sys_state, status.current_mode, status.flight_information),
    *(status.estimator_status, sensors.scaled_pressure, sensors.vibration),
    *(power.battery_status, power.esc_status, power.esc_info, power.servo_output_raw, power.actuator_output_status),
    *(power.actuator_control_target, power.rc_channels),
    *(controller.attitude_target, controller.position_target_local_ned, controller.position_target_global_int),
    *(controller.nav_controller_output, controller.trajectory_representation_waypoints),
    *(controller.debug_float_array, controller.named_value_float),
    *(status.system_time, sensors.highres_imu, sensors.scaled_imu, sensors.raw_imu),
)
"""Named like their messages."""
