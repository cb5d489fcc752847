"""Default rate of each message, and the groups of MAV_DATA_STREAM."""

from collections.abc import Mapping
from typing import NamedTuple

from colibri.mavlink.services.command import DENIED, UNSUPPORTED
from colibri.mavlink.telemetry.encoder import Encoder

HZ = 1_000_000

SDK = "sdk"
GCS = "gcs"
SILENT = "silent"

_RATES_HZ = {
    "ATTITUDE": (100.0, 10.0),
    "GLOBAL_POSITION_INT": (50.0, 5.0),
    "HIGHRES_IMU": (50.0, 1.0),
    "ATTITUDE_QUATERNION": (50.0, 5.0),
    "LOCAL_POSITION_NED": (30.0, 5.0),
    "ODOMETRY": (30.0, 0.0),
    "ATTITUDE_TARGET": (10.0, 2.0),
    "POSITION_TARGET_LOCAL_NED": (10.0, 2.0),
    "SERVO_OUTPUT_RAW": (10.0, 1.0),
    "VFR_HUD": (10.0, 4.0),
    "ALTITUDE": (10.0, 2.0),
    "HIL_STATE_QUATERNION": (10.0, 0.0),
    "GPS_RAW_INT": (8.0, 2.0),
    "SYS_STATUS": (5.0, 1.0),
    "EXTENDED_SYS_STATE": (5.0, 2.0),
    "DISTANCE_SENSOR": (5.0, 0.0),
    "POSITION_TARGET_GLOBAL_INT": (1.0, 2.0),
    "BATTERY_STATUS": (1.0, 1.0),
    "SYSTEM_TIME": (1.0, 1.0),
    "HOME_POSITION": (0.5, 0.5),
    "GPS_GLOBAL_ORIGIN": (0.5, 0.2),
    "CURRENT_MODE": (0.5, 0.5),
    "FLIGHT_INFORMATION": (0.5, 0.0),
    "ESTIMATOR_STATUS": (1.0, 0.5),
    "WIND_COV": (1.0, 0.5),
    "RC_CHANNELS": (1.0, 1.0),
    "SCALED_IMU": (1.0, 0.0),
    "RAW_IMU": (1.0, 0.0),
    "SCALED_PRESSURE": (1.0, 1.0),
    "VIBRATION": (0.5, 0.5),
    "NAV_CONTROLLER_OUTPUT": (1.0, 2.0),
    "ACTUATOR_OUTPUT_STATUS": (1.0, 0.0),
    "ACTUATOR_CONTROL_TARGET": (1.0, 0.0),
    "ESC_STATUS": (1.0, 1.0),
    "ESC_INFO": (0.5, 0.2),
    "TRAJECTORY_REPRESENTATION_WAYPOINTS": (1.0, 1.0),
    "DEBUG_FLOAT_ARRAY": (1.0, 1.0),
    "NAMED_VALUE_FLOAT": (1.0, 1.0),
}
"""On channels to SDKs, and to ground stations; 0 is off.

SDKs request little, so all they can show is streamed: PX4's measured rates on its SDK port; the simulator's truth at
10 Hz; the controller once a second. A ground station gets rates for the eye and for a radio link.
"""


def _intervals(column: int) -> dict[str, int]:
    return {name: round(HZ / rates[column]) for name, rates in _RATES_HZ.items() if rates[column]}


DEFAULTS: dict[str, dict[str, int]] = {SDK: _intervals(0), GCS: _intervals(1), SILENT: {}}  # intervals, µs

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
"""The messages of each MAV_DATA_STREAM, grouped as by ArduPilot: raw sensors, extended status, radio channels, raw
controller, position, extra 1 to 3. MAV_DATA_STREAM_ALL (0) means all groups.
"""


class Streams(NamedTuple):
    """The messages of an identity."""

    groups: Mapping[int, tuple[str, ...]]  # messages of each MAV_DATA_STREAM
    defaults: Mapping[str, Mapping[str, int]]  # interval of each message, us, by the kind of channel
    names: frozenset[str] = frozenset()  # all messages that are sent; empty: every one
    encoders: Mapping[str, Encoder] = {}  # of messages that only this identity sends
    unsent: int = UNSUPPORTED  # MAV_RESULT of a request for another message
    unstreamed: tuple[int, int] = (DENIED, UNSUPPORTED)  # of an interval for a known message, and for any other

    def chosen(self, encoders: Mapping[str, Encoder]) -> dict[str, Encoder]:
        """Return the encoders of this identity's messages."""
        every = {**encoders, **self.encoders}
        return {name: encoder for name, encoder in every.items() if not self.names or name in self.names}


PX4_STREAMS = Streams(GROUPS, DEFAULTS)
