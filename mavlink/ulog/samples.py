"""The vehicle as PX4's topics: control samples, sensor measurements and estimates, status with PX4's mode numbers."""

import numpy as np

from colibri.common.compiled_rotations import quaternion_from_euler
from colibri.common.jit import compiled
from colibri.common.records import Record
from colibri.common.types import Array
from colibri.mavlink.hil.sensors import SensorFrame
from colibri.mavlink.telemetry.snapshot import EstimatorState
from colibri.mavlink.ulog import messages, topics
from colibri.mavlink.ulog.blocks import BLOCK_ROWS, Blocks, Turned, attitude_ned, heading_from_yaw
from colibri.mavlink.ulog.flight_topics import ROTORS
from colibri.mavlink.ulog.topics import Records, record
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, vehicle_type
from colibri.mavlink.wire.ned import frd_from_flu, ned_from_enu

COLUMNS = (
    "time_us",
    *("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "p", "q", "r"),
    *("control1", "control2", "control3", "control4"),
    *("x_ref", "y_ref", "z_ref", "vx_ref", "vy_ref", "vz_ref", "ax_ref", "ay_ref", "az_ref", "yaw_ref", "yaw_rate_ref"),
    *("phi_ref", "theta_ref", "psi_ref"),
    *("qp_status", "fallback", "solve_time_us", "control_step_us", "cost", "slack"),
    *("active_rotors", "active_increments", "active_angles", "active_rates"),
    *("delay_us", "mass_kg", "path_lag_s", "iterations"),
)
"""Columns of a control sample, in SI, ENU and FLU; nan if missing.

Time (µs); position, velocity, attitude (wxyz, FLU to ENU), rates; commanded rotor speeds in parts of the largest, nan
unless armed; references of position, velocity, acceleration, yaw (counter-clockwise from east) and its rate; attitude
setpoint; and the decision, as in `autopilot.csv`. Commands of more than four rotors follow.
"""

_TOPICS = (
    *(topics.ATTITUDE, topics.RATES, topics.POSITION, topics.MOTORS, topics.TRAJECTORY, topics.POSITION_SETPOINT),
    *(topics.ATTITUDE_SETPOINT, topics.MPC),
)
_ATTITUDE, _CONTROLS, _YAW = slice(7, 11), slice(14, 18), slice(27, 29)
_ATTITUDE_REFERENCE, _CODES, _ACTIVE = slice(29, 32), slice(32, 34), slice(38, 42)
_MPC = [COLUMNS.index(name) for name in (*COLUMNS[34:38], *COLUMNS[42:])]

_turned = Turned(
    COLUMNS,
    RATES=(frd_from_flu, "p q r"),
    PLACE=(ned_from_enu, "x y z vx vy vz"),
    REFERENCE=(ned_from_enu, "x_ref y_ref z_ref vx_ref vy_ref vz_ref ax_ref ay_ref az_ref"),
)
_RATES, _PLACE, _REFERENCE = _turned.places.values()


@compiled
def _quaternions(euler: Array) -> Array:
    quaternions = np.empty((euler.shape[0], 4))
    for row in range(euler.shape[0]):
        w, x, y, z = quaternion_from_euler(euler[row, 0], euler[row, 1], euler[row, 2])
        quaternions[row, 0], quaternions[row, 1], quaternions[row, 2], quaternions[row, 3] = w, x, y, z
    return quaternions


class SampleBlocks(Blocks):
    """Encodes rows of `COLUMNS`."""

    def __init__(self, rotors: int = ROTORS) -> None:
        super().__init__(len(COLUMNS) + (ROTORS if rotors > ROTORS else 0))
        self.rotors = rotors
        _quaternions(np.zeros((1, 3)))
        self._records = Records(BLOCK_ROWS, *_TOPICS)
        self._records[topics.POSITION, "xy_valid"][:] = True
        self._records[topics.MOTORS, "control"][:] = np.nan

    def encode(self, table: Array) -> bytes:
        count, records, turned = len(table), self._records, _turned(table)
        for topic in _TOPICS:
            records[topic, "timestamp"][:count] = table[:, :1]
        records[topics.ATTITUDE, "q"][:count] = attitude_ned(table[:, _ATTITUDE])
        records[topics.RATES, "xyz"][:count] = turned[:, _RATES]
        records[topics.POSITION, "x"][:count] = turned[:, _PLACE]
        controls = np.hstack([table[:, _CONTROLS], table[:, len(COLUMNS) :]])[:, : self.rotors]
        records[topics.MOTORS, "control"][:count, : self.rotors] = controls
        yaw_rad, yaw_rate_rad_s = table[:, _YAW].T
        trajectory = records[topics.TRAJECTORY, "position"]
        trajectory[:count, :9] = turned[:, _REFERENCE]
        trajectory[:count, 9], trajectory[:count, 10] = heading_from_yaw(yaw_rad), -yaw_rate_rad_s
        records[topics.POSITION_SETPOINT, "x"][:count] = trajectory[:count]
        steered = records[topics.ATTITUDE_SETPOINT, "q_d"]
        steered[:count, :4] = attitude_ned(_quaternions(table[:, _ATTITUDE_REFERENCE].copy()))
        steered[:count, 6] = -np.square(controls).sum(axis=1) / self.rotors
        records[topics.MPC, "solve_time_us"][:count] = table[:, _MPC]
        records[topics.MPC, "active_rotors"][:count] = table[:, _ACTIVE]
        records[topics.MPC, "qp_status"][:count] = table[:, _CODES]
        return records.first(count)


SENSING_COLUMNS = (
    *("time_us", "fx", "fy", "fz", "p", "q", "r", "flags", "horizontal_accuracy_m", "vertical_accuracy_m"),
    *("heading_ratio", "velocity_ratio", "position_ratio", "height_ratio", "above_ground_ratio"),
)
"""Time (µs), specific force (m/s², FLU), rates (rad/s, FLU); ESTIMATOR_STATUS_FLAGS; standard deviations of the
position; and the last tests' ratios, rejected above 1.
"""

_turned_sensing = Turned(SENSING_COLUMNS, INERTIAL=(frd_from_flu, "p q r fx fy fz"))


def sensing_numbers(time_us: int, sensed: SensorFrame, estimator: EstimatorState) -> tuple[float, ...]:
    velocity, position, height, heading, above_ground, *_ = estimator.ratios
    return (
        *(time_us, *sensed.specific_force_flu_m_s2, *sensed.rate_flu_rad_s, estimator.flags),
        *(estimator.horizontal_accuracy_m, estimator.vertical_accuracy_m),
        *(heading, velocity, position, height, above_ground),
    )


class SensingBlocks(Blocks):
    def __init__(self) -> None:
        super().__init__(len(SENSING_COLUMNS))
        self._records = Records(BLOCK_ROWS, topics.SENSORS, topics.ESTIMATOR)

    def encode(self, table: Array) -> bytes:
        count, records = len(table), self._records
        for topic in (topics.SENSORS, topics.ESTIMATOR):
            records[topic, "timestamp"][:count] = table[:, :1]
        records[topics.SENSORS, "gyro_rad"][:count] = _turned_sensing(table)
        records[topics.ESTIMATOR, "pos_horiz_accuracy"][:count] = table[:, 8:]
        records[topics.ESTIMATOR, "solution_status_flags"][:count] = table[:, 7:8]
        return records.first(count)


_DISARMED, _ARMED = 1, 2
_ROTARY_WING = 1
_NAV_STATES = {
    (7, 0): 15,
    (2, 0): 1,
    (3, 0): 2,
    (3, 1): 21,
    (6, 0): 14,
    (4, 2): 17,
    (4, 3): 4,
    (4, 4): 3,
    (4, 5): 5,
    (4, 6): 18,
    (4, 8): 19,
    (4, 11): 23,
}
"""PX4's main mode and sub mode -> its nav_state; 23, EXTERNAL1, flies a track."""


class VehicleStatus(Record, frozen=True):
    armed: bool
    custom_mode: int  # in PX4's layout
    failsafe: bool = False
    armable: bool = True
    armed_us: int = 0  # last arming; 0 before
    takeoff_us: int = 0  # last take-off; 0 before


def nav_state(custom_mode: int) -> int:
    return _NAV_STATES.get((custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF), 31)


def status_message(time_us: int, status: VehicleStatus, system_id: int, rotors: int = ROTORS) -> bytes:
    mode = nav_state(status.custom_mode)
    who = (_ROTARY_WING, vehicle_type(rotors), system_id, AUTOPILOT_COMPONENT)
    times_us, arming = (time_us, status.armed_us, status.takeoff_us), _ARMED if status.armed else _DISARMED
    return messages.SYNC + record(
        *(topics.STATUS, *times_us, arming, mode, mode, *who), status.failsafe, False, False, status.armable
    )
