"""Control samples as topics: state, setpoint, commands, solver."""

import numpy as np

from colibri.common.compiled_rotations import quaternion_from_euler
from colibri.common.jit import compiled
from colibri.common.types import Array
from colibri.mavlink.ulog import topics
from colibri.mavlink.ulog.blocks import BLOCK_ROWS, Blocks, Turned, attitude_ned, heading_from_yaw
from colibri.mavlink.ulog.flight_topics import ROTORS
from colibri.mavlink.ulog.topics import Records
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
