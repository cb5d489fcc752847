"""Plausibility of values, fixes and frame times."""

from math import inf, isfinite

from colibri.autopilot.estimation.sensing.rejection import Reason, Rejected, RejectedSource
from colibri.common.earth.geodesy import is_on_earth
from colibri.mavlink.hil.sensors import GpsFix
from colibri.plant.vehicle.sensors import Gps

_MAX_SPEED_M_S = 100.0
_MIN_HEIGHT_M, _MAX_HEIGHT_M = -1000.0, 30e3
_MIN_FIX, _BEST_FIX = 3, 6
_GPS_PATIENCE_US = 2_000_000
_NOWHERE = (0.0, 0.0)  # latitude and longitude of receivers without a fix
MAX_GAP_US = 1_000_000
_SETTLED = 25  # frames out of sequence after which the clock counts as reset


class Watch:
    """Checks one sensor; `is_new` is false for values that repeat."""

    def __init__(self, source: str, minimum: float, maximum: float, patience_us: float) -> None:
        self._source, self._minimum, self._maximum, self._patience_us = source, minimum, maximum, patience_us
        self._last: tuple[float, ...] = ()
        self._changed_us = 0
        self.is_new = False

    def accepts(self, values: tuple[float, ...], time_us: int, rejected: Rejected) -> bool:
        least, most = self._minimum, self._maximum
        for value in values:
            if not least <= value <= most:
                rejected.add(self._source, _reason(values))
                return False
        self.is_new = values != self._last
        if self.is_new:
            self._last, self._changed_us = values, time_us
        elif time_us - self._changed_us > self._patience_us:
            rejected.add(self._source, Reason.FROZEN)
            return False
        return True


class GpsWatch:
    def __init__(self, gps: Gps) -> None:
        self.time_us: int | None = None
        self._may_repeat = gps.velocity_noise_m_s == 0.0
        self._alive = Watch(RejectedSource.GPS, -inf, inf, _GPS_PATIENCE_US)

    def accepts(self, fix: GpsFix, now_us: int, rejected: Rejected) -> bool:
        numbers = (*fix.place, *fix.velocity_enu_m_s)
        if not _MIN_FIX <= fix.fix_type <= _BEST_FIX or fix.place[:2] == _NOWHERE:
            rejected.add(RejectedSource.GPS, Reason.NO_FIX)
        elif not _possible(*numbers):
            rejected.add(RejectedSource.GPS, _reason(numbers))
        elif fix.time_us > now_us or (self.time_us is not None and fix.time_us <= self.time_us):
            rejected.add(RejectedSource.GPS, Reason.TIME)
        else:
            self.time_us = fix.time_us
            return self._alive.accepts(numbers, fix.time_us, rejected) and (self._alive.is_new or self._may_repeat)
        return False


class ClockResets:
    """Counts frames out of sequence: few are strays, many are a clock reset."""

    def __init__(self) -> None:
        self._time_us: int | None = None
        self._count = 0

    def settle(self, time_us: int) -> bool:
        follows = self._time_us is not None and 0 < time_us - self._time_us <= MAX_GAP_US
        self._count = self._count + 1 if follows else 1
        self._time_us = time_us
        return self._count >= _SETTLED

    def clear(self) -> None:
        self._time_us = None


def _reason(values: tuple[float, ...]) -> Reason:
    return Reason.RANGE if all(map(isfinite, values)) else Reason.NOT_FINITE


def _possible(latitude_deg: float, longitude_deg: float, altitude_m: float, *velocity_m_s: float) -> bool:
    somewhere = is_on_earth(latitude_deg, longitude_deg) and _MIN_HEIGHT_M <= altitude_m <= _MAX_HEIGHT_M
    return somewhere and all(abs(speed) <= _MAX_SPEED_M_S for speed in velocity_m_s)
