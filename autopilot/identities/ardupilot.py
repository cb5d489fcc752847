"""ArduPilot's conventions: ArduCopter 4.6 as its SITL has them.

Sources: ArduCopter's mode.h, GCS_Copter.cpp and GCS_MAVLink_Copter.cpp, 4.6.
"""

from collections.abc import Callable, Collection
from re import Match, sub

from colibri.autopilot.commander.copter_commands import CopterCommands
from colibri.autopilot.commander.rules.modes import Mode, Need, State
from colibri.autopilot.commander.rules.shown_modes import CUSTOM, STABILIZED, BaseModes, ModeBook, ShownMode
from colibri.autopilot.ground.conventions import Conventions
from colibri.autopilot.ground.onboard_log import DATAFLASH
from colibri.autopilot.guidance.mission.items import COPTER_RULES
from colibri.autopilot.identities.copter_parameters import booted, copter_parameters, count_items
from colibri.autopilot.identities.copter_services import copter_services
from colibri.mavlink.mission.items import FENCE, MISSION, RALLY, MissionItem
from colibri.mavlink.parameters.store import Parameters
from colibri.mavlink.services.command import DENIED, FAILED, command_name
from colibri.mavlink.services.identity import ARDUPILOT as WIRE
from colibri.mavlink.setpoints.offboard import LOCAL_FRAMES
from colibri.mavlink.streaming.rates import GCS, SDK, SILENT, Streams
from colibri.mavlink.telemetry.copter import copter_telemetry
from colibri.mavlink.wire.dialect import Refusal, mav

STABILIZE, ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, LAND, POSHOLD, BRAKE = 0, 2, 3, 4, 5, 6, 7, 9, 16, 17
GUIDED_NOGPS, FOLLOW = 20, 23
_HELD = {Mode.HOLD, Mode.TAKEOFF}
_SEEN: int = STABILIZED | mav.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED


def _mode(number: int, name: str, flies: Mode, *also: Mode, **others: bool) -> ShownMode:
    return ShownMode(number, name, flies, frozenset({flies, *_HELD, *also}), **others)


_FLOWN = (
    _mode(STABILIZE, "STABILIZE", Mode.STABILIZED, guided=False),
    _mode(ALT_HOLD, "ALT_HOLD", Mode.ALTITUDE, guided=False),
    _mode(AUTO, "AUTO", Mode.MISSION, Mode.RETURN, Mode.LAND, waits=True),
    _mode(GUIDED, "GUIDED", Mode.HOLD, Mode.ORBIT, Mode.OFFBOARD, Mode.TRACK),
    _mode(LOITER, "LOITER", Mode.POSITION),
    _mode(RTL, "RTL", Mode.RETURN, to_arm=False),
    _mode(CIRCLE, "CIRCLE", Mode.ORBIT, to_arm=False),
    _mode(LAND, "LAND", Mode.LAND, to_arm=False),
    _mode(POSHOLD, "POSHOLD", Mode.POSITION),
    _mode(BRAKE, "BRAKE", Mode.HOLD, to_arm=False),
    _mode(GUIDED_NOGPS, "GUIDED_NOGPS", Mode.HOLD),
    _mode(FOLLOW, "FOLLOW", Mode.FOLLOW, to_arm=False),
)
_NOT_FLOWN = {
    1: "ACRO",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    18: "THROW",
    19: "AVOID_ADSB",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
    29: "RATE_ACRO",
}
_CHOSEN = {
    Mode.STABILIZED: STABILIZE,
    Mode.ALTITUDE: ALT_HOLD,
    Mode.POSITION: LOITER,
    Mode.HOLD: LOITER,
    Mode.LAND: LAND,
    Mode.TAKEOFF: GUIDED,
    Mode.RETURN: RTL,
    Mode.MISSION: AUTO,
    Mode.OFFBOARD: GUIDED,
    Mode.ORBIT: GUIDED,
    Mode.FOLLOW: FOLLOW,
    Mode.TRACK: GUIDED,
}


def _by_command(p1: float, p2: float, _p3: float) -> tuple[int, str] | Refusal:
    if p1 != p1 or not int(p1) & CUSTOM:
        return Refusal(f"mode: base mode {p1:g} has no custom mode", DENIED)
    return int(p2) if 0.0 <= p2 < 2**24 else -1, f"{p2:g}"


def _by_message(base_mode: int, number: int) -> tuple[int, str] | Refusal:
    return _by_command(float(base_mode), float(number), 0.0)


def _base_modes(shown: ShownMode, state: State, flights: int) -> BaseModes:
    guided = not flights or (state.armed and shown.guided)
    base = _SEEN | (mav.MAV_MODE_FLAG_GUIDED_ENABLED if guided else 0)
    return base, base


MODES = ModeBook(
    modes=(*_FLOWN, *(ShownMode(number, name, to_arm=False) for number, name in _NOT_FLOWN.items())),
    first=STABILIZE,
    chosen=_CHOSEN,
    saved={**_CHOSEN, Mode.HOLD: BRAKE},
    resumed={**_CHOSEN, Mode.HOLD: GUIDED},
    by_command=_by_command,
    by_message=_by_message,
    unknown=lambda said: Refusal(f"No such mode {said}", FAILED),
    refusal=lambda mode, refusal: Refusal(f"Mode change to {mode.name} failed: {_why(refusal.reason)}", FAILED),
    unarmable=lambda mode: Refusal(f"Arm: {mode.name} mode not armable", FAILED),
    base_modes=_base_modes,
    as_command=lambda number: (float(CUSTOM), float(number), 0.0),
    destination=True,
    takeoff=GUIDED,
)


def _why(reason: str) -> str:
    why = reason.partition(" refused: ")[2] or reason
    return {Need.POSITION.value: "requires position", Need.STICKS.value: "in RC failsafe"}.get(why, why)


_EXTRA1, _EXTRA2, _EXTRA3 = mav.MAV_DATA_STREAM_EXTRA1, mav.MAV_DATA_STREAM_EXTRA2, mav.MAV_DATA_STREAM_EXTRA3
_EXTENDED = (
    *("SYS_STATUS", "POWER_STATUS", "MEMINFO", "MISSION_CURRENT", "GPS_RAW_INT"),
    *("NAV_CONTROLLER_OUTPUT", "FENCE_STATUS", "POSITION_TARGET_GLOBAL_INT"),
)
_GROUPS: dict[int, tuple[str, ...]] = {
    mav.MAV_DATA_STREAM_RAW_SENSORS: ("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "SCALED_PRESSURE"),
    mav.MAV_DATA_STREAM_EXTENDED_STATUS: _EXTENDED,
    mav.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    mav.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    _EXTRA1: ("ATTITUDE", "SIMSTATE", "AHRS2"),
    _EXTRA2: ("VFR_HUD",),
    _EXTRA3: ("AHRS", "WIND", "SYSTEM_TIME", "BATTERY_STATUS", "EKF_STATUS_REPORT", "VIBRATION"),
}
_ON_REQUEST = (
    "HOME_POSITION GPS_GLOBAL_ORIGIN EXTENDED_SYS_STATE ATTITUDE_QUATERNION RC_CHANNELS_RAW POSITION_TARGET_LOCAL_NED "
    "SIM_STATE ATTITUDE_TARGET SCALED_IMU HIGHRES_IMU CURRENT_MODE FLIGHT_INFORMATION DISTANCE_SENSOR"
)
_NOTHING: dict[str, int] = {}
STREAMS = Streams(
    groups=_GROUPS,
    defaults={SDK: _NOTHING, GCS: _NOTHING, SILENT: _NOTHING},
    names=frozenset((*(name for names in _GROUPS.values() for name in names), *_ON_REQUEST.split())),
    encoders=copter_telemetry(),
    unsent=FAILED,
    unstreamed=(DENIED, DENIED),
)

_TEXTS: tuple[tuple[str, str | Callable[[Match[str]], str]], ...] = (
    (r"^Arming denied( in \w+)?: (.*?);.*", r"Arm: \2"),
    (r"^Arming denied( in \w+)?: ", "Arm: "),
    (r"^Armed$", "Arming motors"),
    (r"^Disarmed.*", "Disarming motors"),
    (r"^mission of \d+ items$", "Flight plan received"),
    (r"^(mission|geofence|rally points) cleared$|^geofence loaded$|^\d+ rally points$", ""),
    (r"^item (\d+) of the mission", lambda found: f"item {int(found[1]) + 1} of the mission"),
    (r"^Mission RTL item: .*", ""),
    (r"^Takeoff (altitude reached: |detected).*", ""),
    (r"^Landing detected.*", ""),
    (r"^(Arm|PreArm): outside the geofence", r"\1: Vehicle breaching Polygon fence"),
    (r"^(Arm|PreArm): more than [\d.]+ m (from|above) home", r"\1: Vehicle breaching fence"),
    (r"^Failsafe cleared: (battery|setpoints).*", ""),
    (r"^Failsafe cleared: geofence.*", "Fence breach cleared"),
    (r"^Failsafe cleared: (position lost|estimate invalid)", "EKF Failsafe Cleared"),
    (r"^Failsafe cleared: GPS lost", "Glitch cleared"),
    (r"^Failsafe cleared: ground station lost", "GCS Failsafe Cleared"),
    (r"^Failsafe cleared: sticks lost", "Radio Failsafe Cleared"),
    (r"^Warning: ground station lost, continuing ", "GCS Failsafe - Continuing "),
    (r"^Warning: sticks lost, continuing ", "Radio Failsafe - Continuing "),
    (r"^(Failsafe activated|Failsafe): ground station lost.*", "GCS Failsafe"),
    (r"^(Failsafe activated|Failsafe): sticks lost.*", "Radio Failsafe"),
    (r"^(Failsafe activated|Failsafe|Warning): battery (low|critical).*", r"Battery 1 is \2"),
    (r"^(Failsafe activated|Failsafe|Warning): geofence breached.*", "Fence Breached"),
    (r"^Failsafe activated: (position lost|estimate invalid|GPS lost).*", "EKF Failsafe: changed to LAND Mode"),
    (r"^(Failsafe|Warning): GPS lost.*", "GPS Glitch or Compass error"),
)
"""Status texts of Colibri, and ArduCopter's; empty where it sends none."""


def _rewrite(text: str) -> str:
    for pattern, words in _TEXTS:
        text = sub(pattern, words, text)
    return text


_ITEMS = {
    mav.MAV_CMD_NAV_WAYPOINT: "WP",
    mav.MAV_CMD_NAV_TAKEOFF: "Takeoff",
    mav.MAV_CMD_NAV_LAND: "Land",
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: "RTL",
    mav.MAV_CMD_NAV_LOITER_UNLIM: "LoitUnlim",
    mav.MAV_CMD_NAV_LOITER_TURNS: "LoitTurns",
    mav.MAV_CMD_NAV_LOITER_TIME: "LoitTime",
    mav.MAV_CMD_NAV_DELAY: "Delay",
    mav.MAV_CMD_CONDITION_DELAY: "CondDelay",
    mav.MAV_CMD_CONDITION_YAW: "CondYaw",
    mav.MAV_CMD_DO_CHANGE_SPEED: "ChangeSpeed",
    mav.MAV_CMD_DO_JUMP: "Jump",
    mav.MAV_CMD_DO_SET_HOME: "SetHome",
}


_REPORTED = (mav.MAV_CMD_NAV_WAYPOINT, mav.MAV_CMD_NAV_SPLINE_WAYPOINT, mav.MAV_CMD_NAV_LOITER_TIME)


def _describe(seq: int, item: MissionItem, reached: bool) -> str:
    if reached:
        return f"Reached command #{seq}" if item.command in _REPORTED else ""
    return f"Mission: {seq} {_ITEMS.get(item.command, command_name(item.command))}"


def _kept_plans(parameters: Parameters) -> Collection[int]:
    clears = int(parameters["MIS_OPTIONS"]) & 1
    return (FENCE, RALLY) if clears else (MISSION, FENCE, RALLY)


_BANNER = ("ArduCopter V4.6.0-dev (c0118121)", 4 * "c0118121", "Frame: QUAD/PLUS", "ArduPilot Ready")
_ALONG_HEADING = LOCAL_FRAMES[mav.MAV_FRAME_BODY_OFFSET_NED]
CONVENTIONS = Conventions(
    wire=WIRE,
    modes=MODES,
    commands=CopterCommands,
    frames={
        mav.MAV_FRAME_LOCAL_NED: LOCAL_FRAMES[mav.MAV_FRAME_LOCAL_NED],
        mav.MAV_FRAME_LOCAL_OFFSET_NED: LOCAL_FRAMES[mav.MAV_FRAME_LOCAL_OFFSET_NED],
        mav.MAV_FRAME_BODY_NED: _ALONG_HEADING,
        mav.MAV_FRAME_BODY_OFFSET_NED: _ALONG_HEADING,
    },
    streams=STREAMS,
    radio=(1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800),
    parameters=copter_parameters,
    folder_suffix="-ardupilot",
    logs=DATAFLASH,
    booted=booted,
    kept_plans=_kept_plans,
    mission_rules=COPTER_RULES,
    loaded=count_items,
    rewrite=_rewrite,
    banner=_BANNER,
    describe=_describe,
    services=copter_services,
)
