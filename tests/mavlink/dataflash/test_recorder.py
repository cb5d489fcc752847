"""DataFlash: snapshots as ArduPilot's reader sees them."""

from math import isnan, nan, pi, radians
from pathlib import Path
from typing import Any

import pytest

from colibri.common.earth.geodesy import DEFAULT_ORIGIN, Geodetic
from colibri.common.rotations import quaternion_from_euler
from colibri.mavlink.dataflash.recorder import DataFlashRecorder
from colibri.mavlink.hil.sensors import FixType, GpsFix, SensorFrame
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.telemetry.snapshot import BatteryState, HomePosition, Setpoint, TelemetrySnapshot
from colibri.mavlink.wire.dialect import mav
from tests.support.dataflash import read_dataflash

BATTERY = BatteryState(3, 11.1, 12.5, 0.25, 0.75, 300.0, 2.8)
FLYING = TelemetrySnapshot(
    time_us=2_000_000,
    armed=True,
    custom_mode=4,
    landed_state=mav.MAV_LANDED_STATE_IN_AIR,
    position_enu_m=(30.0, 40.0, 12.0),
    velocity_enu_m_s=(3.0, 4.0, -1.5),
    attitude=quaternion_from_euler(radians(10.0), radians(20.0), 0.0),
    rate_flu_rad_s=(0.1, 0.2, 0.3),
    home=HomePosition((0.0, 0.0, 2.0), 0.0),
    controls=(0.5, 0.6, 0.7, 1.0),
    battery=BATTERY,
    setpoint=Setpoint(
        (31.0, 42.0, 13.0), (0.5, 1.5, 2.5), (0.0, 0.1, 0.2), attitude=quaternion_from_euler(0.0, 0.0, pi)
    ),
)
BOOT_UNIX_US = 1_704_067_200_000_000  # 2024-01-01, a Monday: one day and 18 leap seconds into GPS week 2295


def read(tmp_path: Path, *snapshots: TelemetrySnapshot, boot_unix_us: int = 0) -> dict[str, list[Any]]:
    written: list[bytes] = []
    recorder = DataFlashRecorder(written.append, Parameters([]), "ArduCopter V4.7.0", boot_unix_us)
    written.insert(0, recorder.begin())
    for snapshot in snapshots:
        recorder.update(snapshot)
    return read_dataflash(tmp_path / "log.BIN", b"".join(written))[1]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("MODE", {"Mode": 4, "ModeNum": 4}),
        ("ATT", {"Roll": 10.0, "Pitch": -20.0, "Yaw": 90.0, "DesRoll": 0.0, "DesPitch": 0.0, "DesYaw": 270.0}),
        ("RATE", {"R": 5.72958, "P": -11.4592, "Y": -17.1887, "AOut": 0.7}),
        ("CTUN", {"ThO": 0.7, "DAlt": 13.0, "Alt": 12.0, "DCRt": 250, "CRt": -150}),
        ("PSCN", {"TPN": 42.0, "PN": 40.0, "TVN": 1.5, "VN": 4.0, "TAN": 0.1}),
        ("PSCE", {"TPE": 31.0, "PE": 30.0, "TVE": 0.5, "VE": 3.0}),
        ("PSCD", {"TPD": -13.0, "PD": -12.0, "TVD": -2.5, "VD": 1.5}),
        ("RCOU", {"C1": 1500, "C2": 1600, "C3": 1700, "C4": 2000, "C5": 0}),
        ("IMU", {"GyrX": 0.1, "GyrY": -0.2, "GyrZ": -0.3}),
        ("POS", {"RelHomeAlt": 10.0, "RelOriginAlt": 12.0, "Alt": DEFAULT_ORIGIN.altitude_m + 12.0}),
        (
            "GPS",
            {
                "Status": 3,
                "NSats": 12,
                "HDop": 0.7,
                "Spd": 5.0,
                "GCrs": 36.87,
                "VZ": 1.5,
                "GWk": 2295,
                "GMS": 86_420_000,
            },
        ),
        ("BAT", {"Volt": 11.1, "Curr": 12.5, "CurrTot": 250.0, "EnrgTot": 2.8, "RemPct": 75.0}),
        ("ORGN", {"Type": 0, "Lat": DEFAULT_ORIGIN.latitude_deg, "Lng": DEFAULT_ORIGIN.longitude_deg}),
        ("EV", {"Id": 10}),
    ],
)
def test_a_row_has_ardupilots_units_and_frames(tmp_path: Path, name: str, expected: dict[str, float]) -> None:
    row = read(tmp_path, FLYING, boot_unix_us=BOOT_UNIX_US)[name][0]
    assert {field: getattr(row, field) for field in expected} == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_sensors_are_recorded_as_measured(tmp_path: Path) -> None:
    fix = GpsFix(0, FixType.FIX_3D, Geodetic(47.0, 8.0, 500.0), (0.0, -2.0, 0.0), 1.0, 1.0, 9)
    sensed = SensorFrame(0, 0, (1.0, 2.0, 9.0), (0.4, 0.5, 0.6), (0.0, 0.0, 0.0), 95_000.0, 20.0)
    rows = read(tmp_path, FLYING._replace(fix=fix, sensed=sensed))
    imu, gps = rows["IMU"][0], rows["GPS"][0]
    assert (imu.AccX, imu.AccY, imu.AccZ, imu.GyrY) == pytest.approx((1.0, -2.0, -9.0, -0.5))
    assert (gps.Lat, gps.Lng, gps.NSats, gps.GCrs, gps.GWk) == pytest.approx((47.0, 8.0, 9, 180.0, 0))


def test_changes_are_events_and_errors(tmp_path: Path) -> None:
    still = FLYING._replace(landed_state=mav.MAV_LANDED_STATE_ON_GROUND)
    later = [
        still,
        FLYING._replace(fence_breached=True, gps_ok=False, battery=BATTERY._replace(charge_state=2)),
        FLYING,
        still._replace(armed=False, custom_mode=9),
    ]
    rows = read(tmp_path, *(each._replace(time_us=2_000_000 + 8_000 * place) for place, each in enumerate(later)))
    assert [row.Id for row in rows["EV"]] == [10, 28, 11, 18]
    assert [(row.Subsys, row.ECode) for row in rows["ERR"]] == [(6, 1), (9, 1), (11, 1), (6, 0), (9, 0), (11, 0)]
    assert [row.Mode for row in rows["MODE"]] == [4, 9]


@pytest.mark.parametrize("number", [nan, 1e300, -1e300])
def test_a_lost_vehicle_is_recorded_as_far_as_it_has_numbers(tmp_path: Path, number: float) -> None:
    lost = FLYING._replace(position_enu_m=(number, 0.0, number), velocity_enu_m_s=(number,) * 3, controls=(number,) * 4)
    rows = read(tmp_path, lost, FLYING._replace(time_us=3_000_000))
    assert rows["ATT"][0].Roll == pytest.approx(10.0)
    assert isnan(rows["CTUN"][0].Alt) == isnan(number)
    north, east = rows["PSCN"][1], rows["PSCE"][1]
    assert [north.PN, east.PE] == [40.0, 30.0]
    assert len(rows["RCOU"]) == 2
