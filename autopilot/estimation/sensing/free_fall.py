"""Start in the air: rotors stand until the first estimate, so the vehicle falls.

Attitude is unobservable then: assumed level, heading by the magnetic field, with a large covariance, until GPS
corrections find the tilt.
"""

from math import hypot
from typing import NamedTuple

import numpy as np

from colibri.autopilot.estimation.sensing.alignment import attitude_of
from colibri.autopilot.estimation.sensing.inertial import InertialReading
from colibri.common.types import Quaternion, Vector
from colibri.mavlink.hil.sensors import GpsFix

_FALLS_PART = 0.35  # of gravity: largest specific force in a fall with stopped rotors, apart from storms
_FALLS_FOR_US = 40_000
_SINKS_M_S = 0.5
_SURELY_US = 400_000  # after this GPS need not show the fall, so that a rising vehicle is caught too
_UP = np.array([0.0, 0.0, 1.0])


class Caught(NamedTuple):
    """A falling vehicle; `moved_m` is since the fix, ENU, the attitude a guess."""

    velocity_enu_m_s: Vector
    moved_m: Vector
    attitude: Quaternion
    fix: GpsFix
    pressure_height_m: float | None


class Falling:
    """Waits for a fall, unless the first frame is at time 0."""

    def __init__(self, gravity_m_s2: float, field_enu_gauss: Vector, delay_s: float) -> None:
        self._gravity = gravity_m_s2
        self._earth_field = np.array(field_enu_gauss)
        self._delay_us = round(delay_s * 1e6)
        self._begins_in_flight: bool | None = None
        self._since_us: int | None = None
        self._field: Vector | None = None
        self._height_m: float | None = None

    def feed(
        self, time_us: int, reading: InertialReading, field: Vector | None, height_m: float | None, fix: GpsFix | None
    ) -> Caught | None:
        if self._begins_in_flight is None:
            self._begins_in_flight = time_us > 0
        self._field = field or self._field
        self._height_m = self._height_m if height_m is None else height_m
        felt = hypot(*reading.force)
        if not (reading.force_good and reading.rate_good and 0.0 < felt < _FALLS_PART * self._gravity):
            self._since_us = None
            return None
        if self._since_us is None:
            self._since_us = time_us
        falls_us = time_us - self._since_us
        if not self._begins_in_flight or fix is None or self._field is None or falls_us < _FALLS_FOR_US:
            return None
        if fix.velocity_enu_m_s[2] > -_SINKS_M_S and falls_us < _SURELY_US:
            return None
        return self._caught(time_us, fix, self._field)

    def _caught(self, time_us: int, fix: GpsFix, field: Vector) -> Caught:
        assert self._since_us is not None, "it falls"
        measured_us = fix.time_us - self._delay_us
        fallen_s = (time_us - max(measured_us, self._since_us)) * 1e-6
        old_s = (time_us - measured_us) * 1e-6
        ve, vn, vu = fix.velocity_enu_m_s
        sunk_m = 0.5 * self._gravity * fallen_s * fallen_s
        return Caught(
            (ve, vn, vu - self._gravity * fallen_s),
            (ve * old_s, vn * old_s, vu * old_s - sunk_m),
            attitude_of(_UP, np.array(field), self._earth_field),
            fix,
            self._height_m,
        )
