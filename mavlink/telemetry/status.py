"""Messages of the system: health, mode, time."""

from math import isfinite

from colibri.mavlink.node.service import Fields
from colibri.mavlink.telemetry.encoder import UNKNOWN_U16
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.wire.dialect import bits, mav

SENSORS = bits(
    "MAV_SYS_STATUS_", "SENSOR_3D_GYRO SENSOR_3D_ACCEL SENSOR_3D_MAG SENSOR_ABSOLUTE_PRESSURE SENSOR_GPS AHRS LOGGING"
)
CONTROLS = bits(
    "MAV_SYS_STATUS_SENSOR_",
    "ANGULAR_RATE_CONTROL ATTITUDE_STABILIZATION YAW_POSITION Z_ALTITUDE_CONTROL XY_POSITION_CONTROL MOTOR_OUTPUTS",
)
ESTIMATED = bits(
    "ESTIMATOR_",
    "ATTITUDE VELOCITY_HORIZ VELOCITY_VERT POS_HORIZ_REL POS_HORIZ_ABS POS_VERT_ABS POS_VERT_AGL "
    "PRED_POS_HORIZ_REL PRED_POS_HORIZ_ABS",
)


def sys_status(s: TelemetrySnapshot) -> Fields:
    """SYS_STATUS (1): present, enabled and healthy parts; load in thousandths, mV, cA, percent.

    The geofence bit is healthy until a breach, even if disabled: consoles alarm at this bit.
    """
    parts = SENSORS | CONTROLS | mav.MAV_SYS_STATUS_PREARM_CHECK
    if s.battery:
        parts |= mav.MAV_SYS_STATUS_SENSOR_BATTERY
    if s.sticks:
        parts |= mav.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
    if s.estimator is not None:
        parts |= s.estimator.sensors
    fence = mav.MAV_SYS_STATUS_GEOFENCE
    present, enabled = parts | fence, parts | (fence if s.fence_enabled else 0)
    health = parts | (0 if s.fence_breached else fence)
    if not s.gps_ok:
        health &= ~mav.MAV_SYS_STATUS_SENSOR_GPS
    if s.estimator is not None:
        health &= ~s.estimator.failed_sensors
    if not (s.armable or s.armed):  # "always healthy when armed"
        health &= ~mav.MAV_SYS_STATUS_PREARM_CHECK
    return (present, enabled, health, 1e3 * s.load, *_battery(s), 0, 0, 0, 0, 0, 0)


def extended_sys_state(s: TelemetrySnapshot) -> Fields:
    """EXTENDED_SYS_STATE (245): landed, taking off, in the air or landing."""
    return (mav.MAV_VTOL_STATE_UNDEFINED, s.landed_state)


def current_mode(s: TelemetrySnapshot) -> Fields:
    """CURRENT_MODE (436)."""
    return (s.standard_mode, s.custom_mode, s.intended_custom_mode)


def system_time(s: TelemetrySnapshot, boot_unix_us: int = 0) -> Fields:
    """SYSTEM_TIME (2): Unix time µs, 0 if unknown; ms since the start."""
    return (boot_unix_us + s.time_us if boot_unix_us else 0, s.boot_ms)


def flight_information(s: TelemetrySnapshot) -> Fields:
    """FLIGHT_INFORMATION (264): times since the start, µs (despite their names) and ms; flight number."""
    return (s.boot_ms, s.flight_started_us, s.takeoff_us, s.flights, s.landing_us // 1000)


def estimator_status(s: TelemetrySnapshot) -> Fields:
    """ESTIMATOR_STATUS (230). Under state feedback all flags are set and test ratios 0."""
    if s.estimator is not None:
        e = s.estimator
        return (s.time_us, e.flags, *e.ratios, e.horizontal_accuracy_m, e.vertical_accuracy_m)
    finite = all(map(isfinite, (*s.position_enu_m, *s.velocity_enu_m_s, *s.attitude)))
    return (s.time_us, ESTIMATED if finite else 0, *(0.0,) * 8)


def _battery(s: TelemetrySnapshot) -> tuple[float, float, float]:
    if s.battery is None:
        return (UNKNOWN_U16, -1, -1)
    return (1e3 * s.battery.voltage_v, 100.0 * s.battery.current_a, 100.0 * s.battery.remaining)
