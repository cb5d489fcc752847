"""Topics of viewers: names, units and frames of PX4, https://docs.px4.io/main/en/msg_docs/, with part of its fields."""

from collections.abc import Callable, Mapping
from functools import cache
from struct import Struct
from typing import Any

import numpy as np

from colibri.mavlink.ulog import messages
from colibri.mavlink.wire.missing_messages import CODES

_ATTITUDE = "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;"
_RATES = "uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;"
_POSITION = (
    "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;"
    "bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;"
)

ATTITUDE_TRUTH, RATES_TRUTH = "vehicle_attitude_groundtruth", "vehicle_angular_velocity_groundtruth"
POSITION_TRUTH, ESCS, BATTERY = "vehicle_local_position_groundtruth", "esc_status", "battery_status"
ATTITUDE, RATES, POSITION = "vehicle_attitude", "vehicle_angular_velocity", "vehicle_local_position"
MOTORS, TRAJECTORY = "actuator_motors", "trajectory_setpoint"
POSITION_SETPOINT, ATTITUDE_SETPOINT = "vehicle_local_position_setpoint", "vehicle_attitude_setpoint"
MPC, SENSORS, ESTIMATOR, STATUS = "mpc_status", "sensor_combined", "estimator_status", "vehicle_status"

TOPICS: Mapping[str, str] = {
    ATTITUDE_TRUTH: _ATTITUDE,
    RATES_TRUTH: _RATES,
    POSITION_TRUTH: _POSITION,
    ESCS: "uint64_t timestamp;uint8_t esc_count;uint8_t esc_online_flags;uint8_t esc_armed_flags;esc_report[8] esc;",
    BATTERY: (
        "uint64_t timestamp;float voltage_v;float current_a;float discharged_mah;float remaining;"
        "float time_remaining_s;bool connected;uint8_t cell_count;uint8_t warning;"
    ),
    ATTITUDE: _ATTITUDE,
    RATES: _RATES,
    POSITION: _POSITION,
    MOTORS: "uint64_t timestamp;uint64_t timestamp_sample;float[12] control;",
    TRAJECTORY: (
        "uint64_t timestamp;float[3] position;float[3] velocity;float[3] acceleration;float yaw;float yawspeed;"
    ),
    POSITION_SETPOINT: (
        "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;float[3] acceleration;"
        "float yaw;float yawspeed;"
    ),
    ATTITUDE_SETPOINT: "uint64_t timestamp;float[4] q_d;float[3] thrust_body;",
    MPC: (
        "uint64_t timestamp;float solve_time_us;float control_step_us;float cost;float slack;float delay_us;"
        "float mass_kg;float path_lag_s;float iterations;uint16_t active_rotors;uint16_t active_increments;"
        "uint16_t active_angles;uint16_t active_rates;int8_t qp_status;int8_t fallback;"
    ),
    SENSORS: (
        "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;int32_t accelerometer_timestamp_relative;"
    ),
    ESTIMATOR: (
        "uint64_t timestamp;uint64_t timestamp_sample;float pos_horiz_accuracy;float pos_vert_accuracy;"
        "float hdg_test_ratio;float vel_test_ratio;float pos_test_ratio;float hgt_test_ratio;float hagl_test_ratio;"
        "uint16_t solution_status_flags;"
    ),
    STATUS: (
        "uint64_t timestamp;uint64_t armed_time;uint64_t takeoff_time;uint8_t arming_state;uint8_t nav_state;"
        "uint8_t nav_state_user_intention;uint8_t vehicle_type;uint8_t system_type;uint8_t system_id;"
        "uint8_t component_id;bool failsafe;bool is_vtol;bool in_transition_mode;bool pre_flight_checks_pass;"
    ),
}
"""Fields by topic."""

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
