"""MAVSDK-Python's examples that make sense for this vehicle: how each is called, how it ends, what it must bring about.

Left out, because the vehicle has no such part: camera, camera_params, gimbal, gripper, winch. Left out, because they
want a device: ftp_list_dir and ftp_download_file (a serial port), rtk_base_ublox (a receiver), and
px4_ev_automation_keyboard (a keyboard).
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from tests.clients.support import example_flights as flights
from tests.clients.support.example_flights import Evidence

PARAMETERS = "some.params"
URL = "udpin://0.0.0.0:14540"
Judge: TypeAlias = Callable[[Evidence], None]


def plans(missions: int, rally: int, fence: int) -> Judge:
    kinds = (mav.MAV_MISSION_TYPE_MISSION, mav.MAV_MISSION_TYPE_RALLY, mav.MAV_MISSION_TYPE_FENCE)
    wanted = {"mission items": missions, "rally points": rally, "fence items": fence}

    def judge(evidence: Evidence) -> None:
        assert list(map(evidence.seen.plan_length, kinds)) == list(wanted.values())

    judge.__doc__ = "The vehicle has " + " and ".join(f"{count} {name}" for name, count in wanted.items() if count)
    return judge


def prints(pattern: str, times: int, shows: str) -> Judge:
    def judge(evidence: Evidence) -> None:
        evidence.client.wait_printed(pattern, times=times)

    judge.__doc__ = shows
    return judge


def airspeeds(evidence: Evidence) -> None:
    """20 × AIRSPEED reach the other ground station."""
    assert evidence.seen.counts["AIRSPEED"] >= 20, evidence.seen.counts


def calibration(evidence: Evidence) -> None:
    """All four calibrations come to their end."""
    for kind in ("gyro", "accel", "mag", "level"):
        assert f"[cal] calibration done: {kind}" in evidence.seen.texts


def all_params(evidence: Evidence) -> None:
    """Every parameter is printed."""
    count = evidence.seen.request("PARAM_VALUE", "PARAM_REQUEST_READ", "", 0).param_count
    assert len(re.findall(r"(?m)^[A-Z][A-Z0-9_]*: [-\d.e]+$", evidence.client.printed)) == count


def logs(evidence: Evidence) -> None:
    """The log of the flight before is the file that the vehicle keeps, byte for byte."""
    kept = sorted((evidence.state / "0" / "logs").iterdir())
    got = sorted(evidence.client.folder.glob("log-*.ulog"))
    assert kept
    assert [path.read_bytes() for path in got] == [path.read_bytes() for path in kept]
    assert len(got[0].read_bytes()) > 50_000


def uploaded_parameters(evidence: Evidence) -> None:
    """The vehicle has the numbers of the file."""
    assert evidence.seen.parameter("MIS_TAKEOFF_ALT") == 7.5
    assert evidence.seen.parameter("RTL_RETURN_ALT") == 42.0


def untouched(evidence: Evidence) -> None:
    """The vehicle stands as before."""
    now = evidence.seen.now
    assert (now.mode, now.armed, now.flying) == (Mode.HOLD, False, False)


@dataclass(frozen=True, slots=True)
class Example:
    """A script of theirs.

    Attributes:
        name: Its file, without suffix.
        judge: Demands what it must bring about; its docstring says what.
        arguments: Of its command line.
        endless: Whether it never ends by itself: it is ended once the judge is content.
        within_s: By when it must end by itself, wall-clock.
        files: Files beside it that it reads.
        after: An example that is run before it, with the same vehicle.
        written: Files that it reads and that are written for it: name and text.
        options: Of the vehicle that it flies.
    """

    name: str
    judge: Judge
    arguments: tuple[str, ...] = ()
    endless: bool = False
    within_s: float = 60.0
    files: tuple[str, ...] = ()
    after: str = ""
    written: dict[str, str] = field(default_factory=dict)
    options: tuple[str, ...] = ()


def _streams(name: str, pattern: str, times: int, shows: str) -> Example:
    return Example(name, prints(pattern, times, shows), endless=True)


EXAMPLES: tuple[Example, ...] = (
    Example("takeoff_and_land", flights.takeoff_and_land),
    Example("telemetry_takeoff_and_land", flights.telemetry_takeoff_and_land),
    Example("goto", flights.goto, endless=True),
    Example("do_orbit", flights.do_orbit, within_s=120.0),
    Example("mission", flights.mission, within_s=180.0),
    Example("mission_raw", plans(2, 0, 0)),
    Example("mission_import", plans(5, 2, 0), files=("example-mission.plan",)),
    Example("offboard_position_ned", flights.offboard_position_ned, within_s=90.0),
    Example("offboard_velocity_ned", flights.offboard_velocity_ned, within_s=90.0),
    Example("offboard_velocity_body", flights.offboard_velocity_body, within_s=90.0),
    Example("offboard_position_velocity_ned", flights.offboard_position_velocity_ned, within_s=90.0),
    Example("offboard_attitude", flights.offboard_attitude),
    Example("manual_control", flights.manual_control, endless=True),
    Example("follow_me_example", flights.follow_me, within_s=90.0),
    Example("failure_injection", flights.failure_injection, within_s=90.0, options=("--feedback", "sensors")),
    Example("calibration", calibration),
    Example("all_params", all_params),
    Example("firmware_version", prints(r"flight_sw_major: \d+", 1, "A version is printed")),
    Example("geofence", plans(0, 0, 5)),
    Example("logfile_download", logs, after="takeoff_and_land"),
    Example("tune", untouched),
    Example("send_status_message", untouched),  # its server is mostly ended before the line is sent
    Example("mavlink_direct_send", airspeeds),
    _streams("mavlink_direct_receive", "ATTITUDE from 1/1", 100, "100 × ATTITUDE"),
    _streams("highres_imu", r"Time \(us\)", 400, "400 × HIGHRES_IMU"),
    _streams("telemetry", r"Position: |In air: False|Battery: |GPS info: ", 100, "100 lines"),
    _streams("telemetry_flight_mode", "FlightMode: HOLD", 2, "2 × flight mode HOLD"),
    _streams("telemetry_is_armed_is_in_air", "Is_(armed|in_air): False", 4, "4 × neither armed nor in the air"),
    _streams("px4_ev_automation", "Flight Mode: HOLD", 2, "Landed state and flight mode, after 15 s"),
    Example(
        "upload_params",
        uploaded_parameters,
        arguments=(URL, PARAMETERS),
        written={PARAMETERS: "# of two\n1\t1\tMIS_TAKEOFF_ALT\t7.5\t9\n1\t1\tRTL_RETURN_ALT\t42.0\t9\n"},
    ),
    Example("rtcm", untouched),
    _streams("transponder", "Waiting for transponder messages", 3, "Waits; nobody else flies here"),
    Example("shell", prints("nsh> ", 1, "A prompt; it ends at once by itself")),
    Example("show_debug_output", untouched),
)
