"""Whether a sensor can have measured its value: finite, within its range, and alive."""

from math import inf, isfinite

from colibri.autopilot.estimation.sensing.rejection import Reason
from colibri.common.earth.geodesy import is_on_earth
from colibri.mavlink.hil.sensors import GpsFix

_MAX_SPEED_M_S = 100.0
_MIN_HEIGHT_M, _MAX_HEIGHT_M = -1000.0, 30e3
_MIN_FIX, _BEST_FIX = 3, 6
_GPS_PATIENCE_US = 2_000_000
_NOWHERE = (0.0, 0.0)
"""Latitude and longitude of who does not know them, in the Gulf of Guinea."""


class Watch:
    """Watches one sensor.

    Attributes:
        is_new: Whether the last value differs from the one before: what a simulator sends twice is measured once.
    """

    def __init__(self, minimum: float, maximum: float, patience_us: float) -> None:
        """Take values from `minimum` to `maximum`, unless they stay the same to the last bit for `patience_us`."""
        self._minimum, self._maximum, self._patience_us = minimum, maximum, patience_us
        self._last: tuple[float, ...] = ()
        self._changed_us = 0
        self.is_new = False

    def reason(self, values: tuple[float, ...], time_us: int) -> Reason | None:
        """Return why `values`, measured at `time_us`, must be rejected; None if they need not."""
        for value in values:
            if not self._minimum <= value <= self._maximum:
                return Reason.RANGE if all(map(isfinite, values)) else Reason.NOT_FINITE
        self.is_new = values != self._last
        if self.is_new:
            self._last, self._changed_us = values, time_us
        elif time_us - self._changed_us > self._patience_us:
            return Reason.FROZEN
        return None


class GpsWatch:
    """Watches a GPS receiver.

    Attributes:
        time_us: Of the last fix that can be; None before the first.
    """

    def __init__(self) -> None:
        """Begin before the first fix."""
        self.time_us: int | None = None
        self._alive = Watch(-inf, inf, _GPS_PATIENCE_US)

    def reason(self, fix: GpsFix, now_us: int) -> Reason | None:
        """Return why a fix, received by `now_us`, must be rejected; None if it need not."""
        if not _MIN_FIX <= fix.fix_type <= _BEST_FIX or fix.place[:2] == _NOWHERE:
            return Reason.NO_FIX
        numbers = (*fix.place, *fix.velocity_enu_m_s)
        if not _possible(*numbers):
            return Reason.RANGE if all(map(isfinite, numbers)) else Reason.NOT_FINITE
        if fix.time_us > now_us or (self.time_us is not None and fix.time_us <= self.time_us):
            return Reason.TIME
        self.time_us = fix.time_us
        return self._alive.reason(numbers, fix.time_us)


def _possible(latitude_deg: float, longitude_deg: float, altitude_m: float, ve: float, vn: float, vu: float) -> bool:
    return (
        is_on_earth(latitude_deg, longitude_deg)
        and _MIN_HEIGHT_M <= altitude_m <= _MAX_HEIGHT_M
        and -_MAX_SPEED_M_S <= ve <= _MAX_SPEED_M_S
        and -_MAX_SPEED_M_S <= vn <= _MAX_SPEED_M_S
        and -_MAX_SPEED_M_S <= vu <= _MAX_SPEED_M_S
    )
