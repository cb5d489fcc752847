"""Topics of viewers: names, units and frames of PX4, https://docs.px4.io/main/en/msg_docs/, with part of its fields."""

from collections.abc import Callable, Mapping
from functools import cache
from struct import Struct
from typing import Any

import numpy as np

from colibri.mavlink.ulog import messages
from colibri.mavlink.wire.missing_messages import CODES

_ATTITUDE, _RATES = "uint64_t timestamp_sample; float[4] q", "uint64_t timestamp_sample; float[3] xyz"
_POSITION = "uint64_t timestamp_sample; float x y z vx vy vz; bool xy_valid z_valid v_xy_valid v_z_valid"

ATTITUDE_TRUTH, RATES_TRUTH = "vehicle_attitude_groundtruth", "vehicle_angular_velocity_groundtruth"
POSITION_TRUTH, ESCS, BATTERY = "vehicle_local_position_groundtruth", "esc_status", "battery_status"
ATTITUDE, RATES, POSITION = "vehicle_attitude", "vehicle_angular_velocity", "vehicle_local_position"
MOTORS, TRAJECTORY = "actuator_motors", "trajectory_setpoint"
POSITION_SETPOINT, ATTITUDE_SETPOINT = "vehicle_local_position_setpoint", "vehicle_attitude_setpoint"
MPC, SENSORS, ESTIMATOR, STATUS = "mpc_status", "sensor_combined", "estimator_status", "vehicle_status"

_BY_TYPE = {
    ATTITUDE_TRUTH: _ATTITUDE,
    RATES_TRUTH: _RATES,
    POSITION_TRUTH: _POSITION,
    ESCS: "uint8_t esc_count esc_online_flags esc_armed_flags; esc_report[8] esc",
    BATTERY: (
        "float voltage_v current_a discharged_mah remaining time_remaining_s; bool connected; "
        "uint8_t cell_count warning"
    ),
    ATTITUDE: _ATTITUDE,
    RATES: _RATES,
    POSITION: _POSITION,
    MOTORS: "uint64_t timestamp_sample; float[12] control",
    TRAJECTORY: "float[3] position velocity acceleration; float yaw yawspeed",
    POSITION_SETPOINT: "float x y z vx vy vz; float[3] acceleration; float yaw yawspeed",
    ATTITUDE_SETPOINT: "float[4] q_d; float[3] thrust_body",
    MPC: (
        "float solve_time_us control_step_us cost slack delay_us mass_kg path_lag_s iterations; "
        "uint16_t active_rotors active_increments active_angles active_rates; int8_t qp_status fallback"
    ),
    SENSORS: "float[3] gyro_rad accelerometer_m_s2; int32_t accelerometer_timestamp_relative",
    ESTIMATOR: (
        "uint64_t timestamp_sample; float pos_horiz_accuracy pos_vert_accuracy hdg_test_ratio vel_test_ratio "
        "pos_test_ratio hgt_test_ratio hagl_test_ratio; uint16_t solution_status_flags"
    ),
    STATUS: (
        "uint64_t armed_time takeoff_time; uint8_t arming_state nav_state nav_state_user_intention vehicle_type "
        "system_type system_id component_id; bool failsafe is_vtol in_transition_mode pre_flight_checks_pass"
    ),
}


def _spelled(by_type: str) -> str:
    rows = (row.split() for row in f"uint64_t timestamp; {by_type}".split("; "))
    return "".join(f"{kind} {name};" for kind, *names in rows for name in names)


TOPICS: Mapping[str, str] = {topic: _spelled(by_type) for topic, by_type in _BY_TYPE.items()}  # ULog's fields
PARTS = {"esc_report": "uint64_t timestamp;int32_t esc_rpm;"}  # nested types
NUMBERS = {name: number for number, name in enumerate(TOPICS)}  # topic numbers, for all writers of a file
_CODES = {**CODES, "bool": "?"}  # types as in `struct` and NumPy


def record(topic: str, *numbers: float) -> bytes:
    return messages.message("D", _packer(topic)(NUMBERS[topic], *numbers))


@cache
def _packer(topic: str) -> Callable[..., bytes]:
    return Struct("<H" + "".join(code * count for _, code, count in _fields(TOPICS[topic]))).pack


def _fields(text: str) -> list[tuple[str, str, int]]:
    """Return name, type and count of fields; consecutive ones of one type are one array."""
    fields: list[tuple[str, str, int]] = []
    for field in text.split(";")[:-1]:
        kind, name = field.split()
        kind, _, length = kind.partition("[")
        base = _CODES.get(kind, kind)
        count = int(length[:-1]) if length else 1
        if fields and fields[-1][1] == base:
            name, count = fields[-1][0], fields.pop()[2] + count
        fields.append((name, base, count))
    return fields


def _layout(text: str) -> list[tuple[str, Any, tuple[int]]]:
    return [
        (name, _layout(PARTS[kind]) if kind in PARTS else np.dtype(kind).newbyteorder("<"), (count,))
        for name, kind, count in _fields(text)
    ]


def message_layout(fields: str) -> "np.dtype[np.void]":
    return np.dtype([("size", "<u2"), ("kind", "u1"), ("number", "<u2"), *_layout(fields)])


def head(layout: "np.dtype[np.void]", number: int) -> tuple[int, int, int]:
    return layout.itemsize - messages.HEAD_BYTES, messages.DATA, number


class Records:
    """Data messages of some topics; consecutive fields of one type are assigned by the first's name, (rows, fields)."""

    def __init__(self, rows: int, *topics: str) -> None:
        self._rows = np.zeros(rows, [(topic, message_layout(TOPICS[topic])) for topic in topics])
        for topic in topics:
            of_topic = self._rows[topic]
            of_topic["size"], of_topic["kind"], of_topic["number"] = head(of_topic.dtype, NUMBERS[topic])
        self._assigned = {
            (topic, name): self._rows[topic][name] for topic in topics for name, *_ in _fields(TOPICS[topic])
        }

    def __getitem__(self, topic_and_field: tuple[str, str]) -> Any:
        return self._assigned[topic_and_field]

    def first(self, count: int) -> bytes:
        return self._rows[:count].tobytes()
