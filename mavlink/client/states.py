"""The vehicle's own estimate, in its frame and by its clock, from ODOMETRY, or messages of attitude and position."""

from math import isfinite
from typing import Any

from colibri.common.rotations import earth_from_body, quaternion_from_euler
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.state import StateFrame
from colibri.mavlink.wire.dialect import Message, mav
from colibri.mavlink.wire.ned import frd_from_flu, ned_frd_from_enu_flu, ned_from_enu

_MS = 1000
_ODOMETRY_STAYS_US = 500_000  # silence of ODOMETRY after which the other messages count
_PAIRED_US = 60_000  # largest difference in time between an attitude and its position
_EARTH: int = mav.MAV_FRAME_LOCAL_NED

HANDLES = frozenset({"ODOMETRY", "ATTITUDE_QUATERNION", "ATTITUDE", "LOCAL_POSITION_NED"})


class StateAssembler:
    def __init__(self) -> None:
        self._last_us = -1
        self._odometry_us: int | None = None
        self._place: tuple[int, Vector, Vector] | None = None
        self._quaternion_us: int | None = None
        self.refused = 0  # states with non-finite values

    def receive(self, message: Message, now_us: int) -> StateFrame | None:
        name, fields = message.name, message.fields
        if name == "ODOMETRY":
            state = _of_odometry(fields)
            self._odometry_us = now_us
        elif self._odometry_us is not None and now_us - self._odometry_us < _ODOMETRY_STAYS_US:
            return None
        elif name == "LOCAL_POSITION_NED":
            place, velocity = (fields.x, fields.y, fields.z), (fields.vx, fields.vy, fields.vz)
            self._place = (fields.time_boot_ms * _MS, ned_from_enu(place), ned_from_enu(velocity))
            return None
        else:
            state = self._of_attitude(name, fields, now_us)
        if state is None:
            return None
        motion = (*state.position_enu_m, *state.velocity_enu_m_s, *state.attitude, *state.rate_flu_rad_s)
        if not all(map(isfinite, motion)):
            self.refused += 1
            return None
        if state.time_us <= self._last_us and self._last_us - state.time_us < _ODOMETRY_STAYS_US:
            return None
        self._last_us = state.time_us
        return state

    def _of_attitude(self, name: str, fields: Any, now_us: int) -> StateFrame | None:
        if name == "ATTITUDE_QUATERNION":
            self._quaternion_us = now_us
            ned_frd: Quaternion = (fields.q1, fields.q2, fields.q3, fields.q4)
        elif self._quaternion_us is not None and now_us - self._quaternion_us < _ODOMETRY_STAYS_US:
            return None
        else:
            ned_frd = quaternion_from_euler(fields.roll, fields.pitch, fields.yaw)
        rate = frd_from_flu((fields.rollspeed, fields.pitchspeed, fields.yawspeed))
        at_us = fields.time_boot_ms * _MS
        if self._place is None or not -_PAIRED_US <= at_us - self._place[0] <= _PAIRED_US:
            return None
        place_us, (x, y, z), velocity = self._place
        by_s = (at_us - place_us) * 1e-6
        vx, vy, vz = velocity
        place = (x + by_s * vx, y + by_s * vy, z + by_s * vz)
        return StateFrame(at_us, place, velocity, _unit(ned_frd_from_enu_flu(ned_frd)), rate)


def _of_odometry(fields: Any) -> StateFrame | None:
    if fields.frame_id != _EARTH:
        return None
    attitude = _unit(ned_frd_from_enu_flu(tuple(fields.q)))
    wire = (fields.vx, fields.vy, fields.vz)
    by_earth = fields.child_frame_id == _EARTH
    velocity = ned_from_enu(wire) if by_earth else earth_from_body(attitude, frd_from_flu(wire))
    rate = frd_from_flu((fields.rollspeed, fields.pitchspeed, fields.yawspeed))
    return StateFrame(fields.time_usec, ned_from_enu((fields.x, fields.y, fields.z)), velocity, attitude, rate)


def _unit(q: Quaternion) -> Quaternion:
    w, x, y, z = q
    length = (w * w + x * x + y * y + z * z) ** 0.5
    return q if length == 0.0 or not isfinite(length) else (w / length, x / length, y / length, z / length)
