"""What needs no flight, or a short one: parameters, telemetry, a geofence, files, calibration, failures, logs."""

from pathlib import Path
from random import Random
from time import time
from typing import Any

from mavsdk.plugins.calibration import Calibration, CalibrationResult
from mavsdk.plugins.failure import Failure, FailureResult, FailureType, FailureUnit
from mavsdk.plugins.ftp import Ftp, FtpResult
from mavsdk.plugins.geofence import Circle, FenceType, Geofence, GeofenceData, Point, Polygon
from mavsdk.plugins.info import Info
from mavsdk.plugins.log_files import LogFiles, LogFilesResult
from mavsdk.plugins.param import Param, ParamResult
from mavsdk.plugins.telemetry import FixType, FlightMode, LandedState, Telemetry

from tests.clients.mavsdk_scripts.connection import place, refused, streamed, take_off, until

WHOLE, REAL = "SYS_FAILURE_EN", "MIS_TAKEOFF_ALT"
CORNERS_M = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
HOLE_M = 3.0
RATE_HZ = 10.0
STREAMS = {
    *("position", "home", "in_air", "landed_state", "armed", "attitude_quaternion", "attitude_euler"),
    *("attitude_angular_velocity_body", "velocity_ned", "gps_info", "raw_gps", "battery", "flight_mode", "health"),
    *("rc_status", "actuator_output_status", "odometry", "position_velocity_ned", "ground_truth", "imu", "scaled_imu"),
    *("raw_imu", "health_all_ok", "unix_epoch_time", "distance_sensor", "scaled_pressure", "heading", "altitude"),
    *("actuator_control_target", "fixedwing_metrics"),
}
"""Of a vehicle on the ground; of wind it knows nothing there."""


def params(vehicle: Any) -> None:
    param = Param(vehicle)
    everything = param.get_all_params()
    assert WHOLE in [each.name for each in everything.int_params]
    assert REAL in [each.name for each in everything.float_params]
    for value in (1, 0):
        param.set_param_int(WHOLE, value)
        assert param.get_param_int(WHOLE) == value
    for real in (7.25, 3.5):
        param.set_param_float(REAL, real)
        assert param.get_param_float(REAL) == real
    refused(lambda: param.get_param_float("NO_SUCH"), ParamResult.DOES_NOT_EXIST)
    refused(lambda: param.get_param_int(REAL), ParamResult.WRONG_TYPE)


def telemetry(vehicle: Any) -> None:
    telemetry = Telemetry(vehicle)
    heard: set[str] = set()
    for name in STREAMS:
        ask = getattr(telemetry, f"set_rate_{name}", None)
        if ask is not None:
            ask(RATE_HZ)
        getattr(telemetry, f"subscribe_{name}")(lambda *_, name=name: heard.add(name))
    until(lambda: heard == STREAMS, "every stream", 10.0)
    until(telemetry.health_all_ok, "good health", 5.0)
    home, position = telemetry.home(), telemetry.position()
    assert abs(position.latitude_deg - home.latitude_deg) < 1e-6
    assert abs(position.longitude_deg - home.longitude_deg) < 1e-6
    assert abs(position.relative_altitude_m) < 0.05
    assert abs(telemetry.imu().acceleration_frd.down_m_s2 + 9.81) < 0.05
    assert abs(telemetry.attitude_euler().yaw_deg) < 0.1
    assert telemetry.flight_mode() == FlightMode.HOLD
    assert telemetry.landed_state() == LandedState.ON_GROUND
    assert telemetry.gps_info().fix_type >= FixType.FIX_3D
    assert 90.0 < telemetry.battery().remaining_percent <= 100.0
    assert abs(telemetry.unix_epoch_time() * 1e-6 - time()) < 3600.0
    assert not telemetry.armed()
    assert abs(telemetry.get_gps_global_origin().latitude_deg - home.latitude_deg) < 1e-6
    version = Info(vehicle).get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) != (0, 0)


def geofence(vehicle: Any) -> None:
    telemetry, geofence = Telemetry(vehicle), Geofence(vehicle)
    until(lambda: telemetry.health().is_home_position_ok, "home")
    corners = [Point(*place(telemetry, *corner)) for corner in CORNERS_M]
    hole = Circle(Point(*place(telemetry, 10.0, 10.0)), HOLE_M, FenceType.EXCLUSION)
    fence = GeofenceData([Polygon(corners, FenceType.INCLUSION)], [hole])
    geofence.upload_geofence(fence)
    geofence.clear_geofence()
    geofence.upload_geofence(fence)
    kept = geofence.download_geofence()
    assert [len(polygon.points) for polygon in kept.polygons] == [len(corners)]
    assert [(circle.radius, circle.fence_type) for circle in kept.circles] == [(HOLE_M, FenceType.EXCLUSION)]
    for point, corner in zip(kept.polygons[0].points, corners, strict=True):
        assert abs(point.latitude_deg - corner.latitude_deg) < 1e-7
        assert abs(point.longitude_deg - corner.longitude_deg) < 1e-7


def ftp(vehicle: Any) -> None:
    here = Path("exchanged.bin")
    here.write_bytes(Random(1).randbytes(20_000))
    ftp = Ftp(vehicle)
    ftp.create_directory("/notes")
    streamed(lambda report: ftp.upload_async(str(here), "/notes", report), FtpResult.NEXT)
    assert ftp.are_files_identical(str(here), "/notes/exchanged.bin")
    ftp.rename("/notes/exchanged.bin", "/notes/kept.bin")
    assert [entry.name for entry in ftp.list_directory("/notes").entries] == ["kept.bin"]
    Path("back").mkdir()
    for burst in (True, False):
        streamed(lambda report: ftp.download_async("/notes/kept.bin", "back", burst, report), FtpResult.NEXT)  # noqa: B023
        assert Path("back/kept.bin").read_bytes() == here.read_bytes()
        Path("back/kept.bin").unlink()
    ftp.remove_file("/notes/kept.bin")
    ftp.remove_directory("/notes")
    refused(lambda: ftp.list_directory("/notes"), FtpResult.FILE_DOES_NOT_EXIST)


def calibration(vehicle: Any) -> None:
    calibration = Calibration(vehicle)
    for kind in ("gyro", "accelerometer", "magnetometer", "level_horizon"):
        begin = getattr(calibration, f"calibrate_{kind}_async")
        progress = [report.progress for report in streamed(begin, CalibrationResult.NEXT) if report.has_progress]
        assert progress, kind
        assert progress == sorted(progress), (kind, progress)
        assert abs(progress[-1] - 1.0) < 1e-6, (kind, progress)


def failure(vehicle: Any) -> None:
    """Take GPS away for a while: only a parameter allows it."""
    telemetry, failure, param = Telemetry(vehicle), Failure(vehicle), Param(vehicle)
    until(lambda: telemetry.gps_info().fix_type >= FixType.FIX_3D, "a fix")
    refused(lambda: failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0), FailureResult.DISABLED)
    param.set_param_int("SYS_FAILURE_EN", 1)
    failure = Failure(vehicle)  # one that reads the parameter anew
    failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)
    until(lambda: telemetry.gps_info().fix_type < FixType.FIX_2D, "no fix")
    failure.inject(FailureUnit.SENSOR_GPS, FailureType.OK, 0)
    until(lambda: telemetry.gps_info().fix_type >= FixType.FIX_3D, "a fix again")
    param.set_param_int("SYS_FAILURE_EN", 0)


def logs(vehicle: Any) -> None:
    """Download the log of a short flight into the folder where the script runs."""
    action, telemetry = take_off(vehicle, 1.5)
    action.land()
    until(lambda: not telemetry.armed(), "the rotors to stop")
    logs = LogFiles(vehicle)
    (entry,) = logs.get_entries()
    streamed(lambda report: logs.download_log_file_async(entry, "flight.log", report), LogFilesResult.NEXT)
