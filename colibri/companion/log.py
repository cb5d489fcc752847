"""Records of a companion's flight, one row for each setpoint."""

from collections import Counter
from math import acos, cos, dist, nan, sqrt
from typing import NamedTuple

from colibri.autopilot.control.interface import FALLBACK_CODES, Fallback
from colibri.common.types import Vector


class LogRow(NamedTuple):
    """A setpoint and its inputs, for the time of effect; times in s on the companion's clock, m, rad, ENU and FLU.

    `thrust`, 0..1, stands for `thrust_n`; `push_*` is the observed disturbance, m/s²; `fallback` is as in flight.csv,
    -1 after a solved QP.
    """

    t: float
    phase: str
    on_track: int
    track_s: float
    state_age_s: float
    round_trip_s: float
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    phi: float
    theta: float
    psi: float
    p: float
    q: float
    r: float
    ref_x: float
    ref_y: float
    ref_z: float
    ref_vx: float
    ref_vy: float
    ref_vz: float
    ref_psi: float
    error_m: float
    p_cmd: float
    q_cmd: float
    r_cmd: float
    thrust: float
    thrust_n: float
    thrust_scale: float
    push_x: float
    push_y: float
    push_z: float
    fallback: int
    sent: int


class TrackErrors:
    """Distance of the vehicle's own estimate from the track."""

    def __init__(self) -> None:
        self._of: list[tuple[float, float]] = []

    def add(self, track_s: float, reference_enu_m: Vector, position_enu_m: Vector) -> None:
        self._of.append((track_s, dist(reference_enu_m, position_enu_m)))

    def rmse_m(self, after_s: float = 0.0) -> float:
        errors = [error for track_s, error in self._of if track_s >= after_s]
        return sqrt(sum(error * error for error in errors) / len(errors)) if errors else nan

    @property
    def max_m(self) -> float:
        return max((error for _, error in self._of), default=nan)

    @property
    def samples(self) -> int:
        return len(self._of)

    @property
    def flown_s(self) -> float:
        return self._of[-1][0] if self._of else 0.0


class FlightSummary:
    """Totals over the rows: sent setpoints, rows by fallback, seconds by phase."""

    def __init__(self) -> None:
        self.sent = 0
        self.first_s = self.last_s = 0.0
        self.max_tilt_rad = self.max_age_s = 0.0
        self.fallbacks: Counter[Fallback] = Counter()
        self.phases: dict[str, float] = {}
        self._rows = 0

    @property
    def rate_hz(self) -> float:
        return (self._rows - 1) / (self.last_s - self.first_s) if self.last_s > self.first_s else nan

    def add(self, row: LogRow) -> None:
        self._rows += 1
        self.sent += row.sent
        if self._rows == 1:
            self.first_s = self.last_s = row.t
        self.phases[row.phase] = self.phases.get(row.phase, 0.0) + row.t - self.last_s
        self.last_s = row.t
        self.max_tilt_rad = max(self.max_tilt_rad, acos(min(max(cos(row.phi) * cos(row.theta), -1.0), 1.0)))
        self.max_age_s = max(self.max_age_s, row.state_age_s)
        for fallback, code in FALLBACK_CODES.items():
            if fallback is not None and code == row.fallback:
                self.fallbacks[fallback] += 1
