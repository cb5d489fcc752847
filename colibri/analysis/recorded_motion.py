"""The motion of a vehicle and its rotor commands from a log: Colibri's, PX4's (ULog) or ArduPilot's (DataFlash)."""

from collections.abc import Mapping
from math import inf, pi
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from colibri.analysis.export import read_log
from colibri.common.errors import Error
from colibri.common.types import Array
from colibri.mavlink.dataflash.reader import read_dataflash

_GRAVITY_M_S2 = 9.81
_RAD_S_PER_RPM = 2.0 * pi / 60.0
_ROTORS = range(8)
_MOTOR1 = 33  # of ArduPilot's SERVOn_FUNCTION
_ENU = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from NED, and back
_FLU = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))  # from FRD, and back

_Tables: TypeAlias = Mapping[str, Mapping[str, Any]]
"""Columns of each topic or message."""


class LogError(Error):
    """A log from which a vehicle cannot be identified."""


class Series(NamedTuple):
    t_s: Array
    values: Array  # (n, columns)

    @property
    def interval_s(self) -> float:
        return float(np.median(np.diff(self.t_s)))

    def at(self, t_s: Array) -> Array:
        """Return the values at other times, linearly interpolated."""
        return np.stack([np.interp(t_s, self.t_s, column) for column in self.values.T], axis=1)


class Motion(NamedTuple):
    """FLU, ENU and SI."""

    attitude: Slerp  # FLU to ENU
    rate: Series
    velocity: Series
    force: Series  # specific force
    command: Series  # 0 to 1
    speed: Series | None  # measured rotor speeds, rad/s
    is_numbered: bool  # rotors are in the order of PX4 and ArduPilot; else in that of the vehicle file


def read_motion(path: Path) -> Motion:
    """Read a log by the end of its name: `.bin` is ArduPilot's, everything else a ULog.

    Raises:
        Error: The log is unreadable, or a message is missing.
    """
    if path.suffix.lower() == ".bin":
        names = ("ATT", "RATE", "IMU", "RCOU", "XKF1", "PSCN", "PSCE", "PSCD")
        return _ardupilot(*read_dataflash(path, names))
    tables: _Tables = {topic.name: topic.data for topic in read_log(path).data_list if topic.multi_id == 0}
    return _colibri(tables) if "colibri_truth" in tables else _px4(tables)


def _series(tables: _Tables, name: str, *columns: str) -> Series:
    table = tables.get(name, {})
    time_us = table.get("timestamp", table.get("TimeUS"))
    if time_us is None or not set(columns) <= set(table):
        raise LogError(f"{name} ({', '.join(columns)}) is missing: log attitude, rates, velocity and motor outputs")
    values = np.array([table[column] for column in columns], float).T
    known = np.flatnonzero((np.abs(values) < inf).any(axis=1))  # motors that are missing are nan
    t_s, first = np.unique(1e-6 * np.asarray(time_us)[known], return_index=True)
    if len(t_s) < 2:
        raise LogError(f"{name} has no numbers")
    return Series(t_s, np.nan_to_num(values[known[first]], posinf=0.0, neginf=0.0))


def _vector(tables: _Tables, topic: str, field: str, size: int = 3) -> Series:
    return _series(tables, topic, *(f"{field}[{place}]" for place in range(size)))


def _turned(rotation: Rotation, series: Series) -> Series:
    return Series(series.t_s, rotation.apply(series.values))


def _colibri(tables: _Tables) -> Motion:
    """Return the true motion, and the commands, of each frame."""

    def of_rotors(topic: str, column: str) -> Series:
        first = _series(tables, f"colibri_{topic}", *(f"{column}{rotor}" for rotor in (1, 2, 3, 4)))
        if f"colibri_more_{topic}" not in tables:
            return first
        more = _series(tables, f"colibri_more_{topic}", *(f"{column}{rotor}" for rotor in (5, 6, 7, 8)))
        return Series(first.t_s, np.hstack([first.values, more.at(first.t_s)]))

    attitude = _series(tables, "colibri_truth", "qw", "qx", "qy", "qz")
    turn = Rotation.from_quat(attitude.values, scalar_first=True)
    velocity = _turned(turn, _series(tables, "colibri_truth", *"uvw"))
    slerp = Slerp(attitude.t_s, turn)
    middle_s = 0.5 * (velocity.t_s[1:] + velocity.t_s[:-1])
    acceleration = np.diff(velocity.values, axis=0) / np.diff(velocity.t_s)[:, None]
    force = slerp(middle_s).apply(acceleration + np.array([0.0, 0.0, _GRAVITY_M_S2]), inverse=True)
    rate, command, speed = (
        _series(tables, "colibri_truth", *"pqr"),
        of_rotors("command", "control"),
        of_rotors("truth", "omega"),
    )
    if _series(tables, "esc_status", "esc[0].esc_rpm").values.max() < 3.0 * speed.values[:, 0].max():
        speed = Series(speed.t_s, _RAD_S_PER_RPM * speed.values)  # the vehicle's file is in rpm
    return Motion(slerp, rate, velocity, Series(middle_s, force), command, speed, is_numbered=False)


def _px4(tables: _Tables) -> Motion:
    attitude = _vector(tables, "vehicle_attitude", "q", 4)
    slerp = Slerp(attitude.t_s, _ENU * Rotation.from_quat(attitude.values, scalar_first=True) * _FLU)
    rate = _turned(_FLU, _vector(tables, "vehicle_angular_velocity", "xyz"))
    velocity = _turned(_ENU, _series(tables, "vehicle_local_position", "vx", "vy", "vz"))
    force = _turned(_FLU, _vector(tables, "sensor_combined", "accelerometer_m_s2"))
    command, speed = _vector(tables, "actuator_motors", "control", len(_ROTORS)), None
    if "esc_status" in tables:
        rpm = _series(tables, "esc_status", *(f"esc[{rotor}].esc_rpm" for rotor in _ROTORS))
        speed = Series(rpm.t_s, _RAD_S_PER_RPM * rpm.values) if rpm.values.any() else None
    return Motion(slerp, rate, velocity, force, command, speed, is_numbered=True)


def _ardupilot(tables: _Tables, parameters: dict[str, float]) -> Motion:
    angles, rate = _series(tables, "ATT", "Yaw", "Pitch", "Roll"), _series(tables, "RATE", "R", "P", "Y")
    slerp = Slerp(angles.t_s, _ENU * Rotation.from_euler("ZYX", angles.values, degrees=True) * _FLU)
    rate = _turned(_FLU, Series(rate.t_s, np.radians(rate.values)))
    if "XKF10" in tables:
        velocity = _series(tables, "XKF10", "VN", "VE", "VD")
    else:
        north, *others = (_series(tables, f"PSC{axis}", f"V{axis}") for axis in "NED")
        velocity = Series(north.t_s, np.hstack([north.values, *(other.at(north.t_s) for other in others)]))
    force = _turned(_FLU, _series(tables, "IMU0", "AccX", "AccY", "AccZ"))
    channels = {parameters.get(f"SERVO{channel}_FUNCTION"): channel for channel in range(1, 15)}
    numbers = [channels[_MOTOR1 + rotor] for rotor in _ROTORS if _MOTOR1 + rotor in channels]
    pulses = _series(tables, "RCOU", *(f"C{number}" for number in numbers or range(1, 9)))
    low, high = parameters.get("MOT_PWM_MIN") or 1000.0, parameters.get("MOT_PWM_MAX") or 2000.0
    command = Series(pulses.t_s, (pulses.values - low) / (high - low))
    return Motion(slerp, rate, _turned(_ENU, velocity), force, command, speed=None, is_numbered=True)
