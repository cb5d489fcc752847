"""The truth in PX4's topics, for viewers."""

from math import isnan, nan, pi

import numpy as np

from colibri.common.types import Array
from colibri.mavlink.ulog import topics
from colibri.mavlink.ulog.blocks import BLOCK_ROWS, Blocks, Turned, attitude_ned
from colibri.mavlink.ulog.flight_topics import ROTORS, TRUTH
from colibri.mavlink.ulog.topics import Records, record
from colibri.mavlink.wire.ned import frd_from_flu, ned_from_enu

_UNKNOWN, _NO_WARNING = -1.0, 0
_S_PER_H = 3600.0

_turned = Turned(TRUTH.names, RATES=(frd_from_flu, "p q r"), POSITION=(ned_from_enu, "x y z"))
_RATES, _POSITION = _turned.places.values()


class TruthBlocks(Blocks):
    """Encodes rows of `TRUTH`, time in µs, each with that of `MORE_TRUTH`; `capacity_ah` is 0 without a battery."""

    def __init__(self, rad_s_per_speed_unit: float, capacity_ah: float, rotors: int = ROTORS) -> None:
        more = rotors > ROTORS
        super().__init__(len(TRUTH.names) + more * ROTORS)
        omegas = TRUTH.names.index("omega1")
        self._omegas = [*range(omegas, omegas + ROTORS), *range(len(TRUTH.names), len(TRUTH.names) + more * ROTORS)]
        self._capacity_ah = capacity_ah
        self._rpm_per_unit = rad_s_per_speed_unit * 30.0 / pi
        self._charge_s = self._charge_ah = nan
        self._records = Records(
            BLOCK_ROWS, topics.ATTITUDE_TRUTH, topics.RATES_TRUTH, topics.POSITION_TRUTH, topics.ESCS
        )
        self._records[topics.POSITION_TRUTH, "xy_valid"][:] = True
        self._records[topics.ESCS, "esc_count"][:] = (rotors, *(2**rotors - 1,) * 2)

    def encode(self, table: Array) -> bytes:
        count, records, turned = len(table), self._records, _turned(table)
        time_us = table[:, :1]
        for topic in (topics.ATTITUDE_TRUTH, topics.RATES_TRUTH, topics.POSITION_TRUTH, topics.ESCS):
            records[topic, "timestamp"][:count] = time_us
        records[topics.ATTITUDE_TRUTH, "q"][:count] = attitude_ned(table[:, 10:14])
        records[topics.RATES_TRUTH, "xyz"][:count] = turned[:, _RATES]
        position = records[topics.POSITION_TRUTH, "x"]
        position[:count, :3] = turned[:, _POSITION]
        for place, velocity in enumerate(ned_from_enu(_rotated(table[:, 10:14].T, table[:, 1:4].T)), start=3):
            position[:count, place] = velocity
        escs = records[topics.ESCS, "esc"][:count]
        escs["timestamp"] = time_us[:, None]
        rpm = np.nan_to_num(self._rpm_per_unit * table[:, self._omegas])
        escs["esc_rpm"][:, : rpm.shape[1], 0] = np.rint(rpm)
        return records.first(count) + self._battery(*table[-1, [0, 18, 19]].tolist())

    def _battery(self, time_us: float, voltage_v: float, charge_ah: float) -> bytes:
        if not self._capacity_ah:
            return b""
        time_s = time_us / 1e6
        elapsed_s, used_ah = time_s - self._charge_s, charge_ah - self._charge_ah
        self._charge_s, self._charge_ah = time_s, charge_ah
        current_a = _S_PER_H * used_ah / elapsed_s if elapsed_s > 0.0 else _UNKNOWN
        remaining = min(max(1.0 - charge_ah / self._capacity_ah, 0.0), 1.0)
        known = (0.0 if isnan(voltage_v) else voltage_v, current_a, 1e3 * charge_ah, remaining, nan)
        return record(topics.BATTERY, int(time_us), *known, True, 0, _NO_WARNING)


def _rotated(attitude: Array, vector: Array) -> tuple[Array, Array, Array]:
    """Rotate vectors (3, n) by attitudes (4, n): v + w t + q x t, t = 2 q x v."""
    w, x, y, z = attitude
    u, v, s = vector
    tx, ty, tz = 2.0 * (y * s - z * v), 2.0 * (z * u - x * s), 2.0 * (x * v - y * u)
    return (u + w * tx + y * tz - z * ty, v + w * ty + z * tx - x * tz, s + w * tz + x * ty - y * tx)
