"""Every message of telemetry, from the snapshot over the wire: values in the units and frames of its definition."""

from math import cos, degrees, isnan, pi, radians, sin
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from colibri.mavlink.telemetry.snapshot import BatteryState, TelemetrySnapshot
from colibri.mavlink.telemetry.table import telemetry
from colibri.mavlink.wire.dialect import mav
from tests.support.snapshots import ARBITRARY, FLYING, TELEMETRY, sent

METRES_A_DEGREE = radians(1.0) * 6371000.0
LATITUDE_E7 = round((47.0 + 20.0 / METRES_A_DEGREE) * 1e7)
LONGITUDE_E7 = round((8.0 + 10.0 / (METRES_A_DEGREE * cos(radians(47.0)))) * 1e7)

MS = {"time_boot_ms": 12345}
US = {"time_usec": 12_345_678}
RATES = {"rollspeed": 0.1, "pitchspeed": -0.2, "yawspeed": -0.3}
EXPECTED: dict[str, dict[str, Any]] = {
    "GLOBAL_POSITION_INT": {**MS, "alt": 430_000, "relative_alt": 25_000, "vx": 400, "vy": 300, "vz": 150, "hdg": 0},
    "LOCAL_POSITION_NED": {**MS, "x": 20.0, "y": 10.0, "z": -30.0, "vx": 4.0, "vy": 3.0, "vz": 1.5},
    "ATTITUDE": {**MS, "roll": 0.1, "pitch": -0.2, "yaw": 0.0, **RATES},
    "ATTITUDE_QUATERNION": {**MS, **RATES},
    "HOME_POSITION": {"altitude": 405_000, "x": 2.0, "y": 1.0, "z": -5.0, "q": [cos(pi / 4), 0.0, 0.0, sin(pi / 4)]},
    "GPS_GLOBAL_ORIGIN": {"latitude": 470_000_000, "longitude": 80_000_000, "altitude": 400_000, **US},
    "GPS_RAW_INT": {**US, "fix_type": 3, "alt": 430_000, "vel": 500, "cog": round(100 * degrees(0.6435011))},
    "ALTITUDE": {
        **US,
        "altitude_monotonic": 430.0,
        "altitude_amsl": 430.0,
        "altitude_local": 30.0,
        "altitude_relative": 25.0,
        "altitude_terrain": 30.0,
        "bottom_clearance": 30.0,
    },
    "VFR_HUD": {
        "airspeed": (4.0 + 4.0 + 2.25) ** 0.5,
        "groundspeed": 5.0,
        "heading": 0,
        "throttle": 65,
        "alt": 430.0,
        "climb": -1.5,
    },
    "DISTANCE_SENSOR": {**MS, "current_distance": 3000, "orientation": mav.MAV_SENSOR_ROTATION_PITCH_270},
    "WIND_COV": {**US, "wind_x": 2.0, "wind_y": 1.0, "wind_z": 0.0, "wind_alt": 430.0},
    "ODOMETRY": {**US, "frame_id": 1, "child_frame_id": 12, "x": 20.0, "y": 10.0, "z": -30.0, **RATES, "quality": 100},
    "HIL_STATE_QUATERNION": {**US, "alt": 430_000, "vx": 400, "vy": 300, "vz": 150, "true_airspeed": 320, "xacc": 0},
    "SYS_STATUS": {"load": 125, "voltage_battery": 11_100, "current_battery": 1400, "battery_remaining": 10},
    "EXTENDED_SYS_STATE": {"vtol_state": 0, "landed_state": 2},
    "CURRENT_MODE": {"standard_mode": 1, "custom_mode": 3 << 16, "intended_custom_mode": 4 << 16},
    "FLIGHT_INFORMATION": {
        **MS,
        "arming_time_utc": 1_000_000,
        "takeoff_time_utc": 2_000_000,
        "flight_uuid": 4,
        "landing_time": 0,
    },
    "ESTIMATOR_STATUS": {**US, "flags": 0x37F, "pos_horiz_ratio": 0.0},
    "SYSTEM_TIME": {"time_unix_usec": 0, **MS},
    "BATTERY_STATUS": {
        "voltages": [3700] * 3 + [65535] * 7,
        "current_battery": 1400,
        "current_consumed": 500,
        "energy_consumed": 180,
        "battery_remaining": 10,
        "time_remaining": 240,
        "charge_state": mav.MAV_BATTERY_CHARGE_STATE_LOW,
        "voltages_ext": [0] * 4,
        "temperature": 32767,
    },
    "HIGHRES_IMU": {**US, "xgyro": 0.1, "ygyro": -0.2, "zgyro": -0.3, "pressure_alt": 430.0, "fields_updated": 0x1BFF},
    "SCALED_IMU": {**MS, "xgyro": 100, "ygyro": -200, "zgyro": -300},
    "RAW_IMU": {**US, "xgyro": 100, "ygyro": -200, "zgyro": -300},
    "SCALED_PRESSURE": {**MS, "press_abs": 962.7, "temperature": 1220},
    "VIBRATION": {**US, "vibration_x": 0.0, "clipping_0": 0},
    "ESC_STATUS": {
        **US,
        "index": 0,
        "rpm": [955, 1910, 955, 1910],
        "voltage": [11.1] * 4,
        "current": [14 / 18, 14 * 8 / 18] * 2,
    },
    "ESC_INFO": {**US, "index": 0, "counter": 12, "count": 4, "info": 15, "temperature": [32767] * 4},
    "SERVO_OUTPUT_RAW": {**US, "servo1_raw": 1500, "servo2_raw": 1600, "servo4_raw": 1800, "servo5_raw": 0},
    "ACTUATOR_OUTPUT_STATUS": {**US, "active": 15, "actuator": [1500.0, 1600.0, 1700.0, 1800.0] + [0.0] * 28},
    "ACTUATOR_CONTROL_TARGET": {**US, "group_mlx": 0, "controls": [0.1, -0.1, -0.1, 0.65, 0.0, 0.0, 0.0, 0.0]},
    "RC_CHANNELS": {
        **MS,
        "chancount": 4,
        "chan1_raw": 1250,
        "chan2_raw": 1750,
        "chan3_raw": 1250,
        "chan4_raw": 2000,
        "chan5_raw": 65535,
    },
    "ATTITUDE_TARGET": {
        **MS,
        "type_mask": 0,
        "body_roll_rate": 0.1,
        "body_pitch_rate": -0.2,
        "body_yaw_rate": -0.3,
        "thrust": 0.55,
    },
    "POSITION_TARGET_LOCAL_NED": {
        **MS,
        "coordinate_frame": 1,
        "type_mask": 0x9C0,
        "x": 24.0,
        "y": 13.0,
        "z": -32.0,
        "vx": 2.0,
        "vy": 1.0,
        "vz": -3.0,
        "yaw": pi / 2,
    },
    "POSITION_TARGET_GLOBAL_INT": {**MS, "coordinate_frame": 0, "type_mask": 0x9C0, "alt": 432.0, "yaw": pi / 2},
    "NAV_CONTROLLER_OUTPUT": {
        "nav_roll": degrees(0.1),
        "nav_pitch": -degrees(0.2),
        "nav_bearing": 90,
        "target_bearing": 37,
        "wp_dist": 5,
        "alt_error": 2.0,
    },
    "TRAJECTORY_REPRESENTATION_WAYPOINTS": {
        **US,
        "valid_points": 5,
        "pos_x": [4.0, 8.0, 12.0, 16.0, 20.0],
        "pos_y": [2.0, 4.0, 6.0, 8.0, 10.0],
        "pos_z": [-6.0, -12.0, -18.0, -24.0, -30.0],
        "vel_y": [0.2, 0.4, 0.6, 0.8, 1.0],
        "acc_x": [0.2, 0.4, 0.6, 0.8, 1.0],
        "pos_yaw": [0.0] * 5,
        "vel_yaw": [-0.5] * 5,
        "command": [65535] * 5,
    },
    "DEBUG_FLOAT_ARRAY": {
        **US,
        "name": "lpv_mpc",
        "data": [0.0, -1.0, 7.0, 100.0, 200.0, 5.5, 0.25, 1.0, 2.0, 3.0, 4.0]
        + [0.1, 0.2, 0.3, 0.4] * 2
        + [0.0] * (58 - 11 - 8),
    },
}


@pytest.mark.parametrize("name", EXPECTED)
def test_a_message_tells_the_snapshot(name: str) -> None:
    (fields,) = sent(name, FLYING)
    for field, value in EXPECTED[name].items():
        received = getattr(fields, field)
        received = list(received) if isinstance(received, tuple) else received
        assert received == (value if isinstance(value, str) else pytest.approx(value, rel=1e-4, abs=1e-6)), field


def test_every_message_is_checked() -> None:
    assert EXPECTED.keys() | {"NAMED_VALUE_FLOAT"} == TELEMETRY.keys()


@pytest.mark.parametrize("name", ["GLOBAL_POSITION_INT", "GPS_RAW_INT", "HIL_STATE_QUATERNION"])
def test_a_place_is_told_to_a_centimetre(name: str) -> None:
    (fields,) = sent(name, FLYING)
    assert fields.lat == pytest.approx(LATITUDE_E7, abs=1)
    assert fields.lon == pytest.approx(LONGITUDE_E7, abs=1)


def test_each_figure_of_the_solver_has_a_name() -> None:
    figures = {fields.name: fields.value for fields in sent("NAMED_VALUE_FLOAT", FLYING)}
    assert len(figures) == 9
    assert figures["mpc_iter"] == 7.0
    assert figures["mpc_us"] == pytest.approx(100.0)
    assert figures["mpc_active"] == 10.0
    weighed = FLYING._replace(solver=FLYING.solver._replace(mass_kg=0.75))
    assert {fields.name: fields.value for fields in sent("NAMED_VALUE_FLOAT", weighed)} == figures | {"mass_kg": 0.75}


@pytest.mark.parametrize("name", ["HOME_POSITION", "BATTERY_STATUS", "WIND_COV", "TRAJECTORY_REPRESENTATION_WAYPOINTS"])
def test_what_is_not_known_is_not_told(name: str) -> None:
    assert TELEMETRY[name](TelemetrySnapshot(time_us=0)) is None


def test_unknown_values_are_those_of_the_definition() -> None:
    bare = TelemetrySnapshot(time_us=0)
    (status,) = sent("SYS_STATUS", bare)
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (65535, -1, -1)
    (radio,) = sent("RC_CHANNELS", bare)
    assert (radio.chancount, radio.chan1_raw, radio.rssi) == (0, 65535, 255)
    (gps,) = sent("GPS_RAW_INT", bare)
    assert gps.cog == 65535
    (target,) = sent("POSITION_TARGET_LOCAL_NED", bare)
    assert target.type_mask == 0xDFF
    assert isnan(target.x)
    (odometry,) = sent("ODOMETRY", bare)
    assert isnan(odometry.pose_covariance[0])


PREARM, GEOFENCE = mav.MAV_SYS_STATUS_PREARM_CHECK, mav.MAV_SYS_STATUS_GEOFENCE


@pytest.mark.parametrize(
    ("changes", "bit", "enabled", "healthy"),
    [
        ({}, PREARM, True, True),
        ({"armable": False}, PREARM, True, False),
        ({"armable": False, "armed": True}, PREARM, True, True),
        ({"fence_enabled": False}, GEOFENCE, False, True),
        ({"fence_enabled": True}, GEOFENCE, True, True),
        ({"fence_enabled": True, "fence_breached": True}, GEOFENCE, True, False),
    ],
)
def test_arming_checks_and_the_fence_are_a_bit_each(
    changes: dict[str, Any], bit: int, enabled: bool, healthy: bool
) -> None:
    (fields,) = sent("SYS_STATUS", TelemetrySnapshot(time_us=0, **changes))
    assert bit == GEOFENCE or fields.onboard_control_sensors_present & bit
    assert bool(fields.onboard_control_sensors_enabled & bit) is enabled
    assert bool(fields.onboard_control_sensors_health & bit) is healthy


def test_health_is_what_clients_wait_for() -> None:
    (fields,) = sent("SYS_STATUS", FLYING)
    wanted = 1 | 2 | 4 | 8 | 32 | mav.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS | mav.MAV_SYS_STATUS_SENSOR_BATTERY
    assert fields.onboard_control_sensors_present & wanted == wanted
    assert fields.onboard_control_sensors_health & wanted == wanted


@pytest.mark.parametrize(("cells", "ext"), [(14, [3700] * 4), (12, [3700] * 2 + [0] * 2), (10, [0] * 4)])
def test_many_cells_go_on_in_the_extension(cells: int, ext: list[int]) -> None:
    battery = BatteryState(cells, 3.7 * cells, 1.0, 0.0, 1.0, 60.0, 0.0)
    (fields,) = sent("BATTERY_STATUS", FLYING._replace(battery=battery))
    assert list(fields.voltages) == [3700] * 10
    assert list(fields.voltages_ext) == ext


def test_unknown_cells_are_told_as_one() -> None:
    battery = BatteryState(0, 11.1, 1.0, 0.0, 1.0, 60.0, 0.0)
    (fields,) = sent("BATTERY_STATUS", FLYING._replace(battery=battery))
    assert list(fields.voltages) == [11_100] + [65535] * 9


def test_unix_time_goes_on_from_the_start() -> None:
    table = telemetry(1_800_000_000_000_000)
    (fields,) = sent("SYSTEM_TIME", FLYING, table)
    assert fields.time_unix_usec == 1_800_000_012_345_678


@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(ARBITRARY)
def test_whatever_the_snapshot_holds_nothing_raises(snapshot: TelemetrySnapshot) -> None:
    for name in TELEMETRY:
        sent(name, snapshot)
