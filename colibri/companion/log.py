"""What a companion remembers of its flight: a row for each setpoint."""

from collections import Counter
from math import acos, cos, dist, nan, sqrt
from typing import NamedTuple

from colibri.autopilot.control.interface import FALLBACK_CODES, Fallback
from colibri.common.types import Vector


class LogRow(NamedTuple):
    """One setpoint, and what it was made of; times in s of the own clock, m, rad, ENU and FLU.

    Attributes:
        on_track: 1 where the reference is the track's own.
        track_s: Time along the track; negative before it.
        state_age_s: Of the newest state.
        round_trip_s: To the vehicle and back.
        x, y, z, vx, vy, vz, phi, theta, psi, p, q, r: The vehicle as predicted for the instant of effect.
        ref_x, ref_y, ref_z, ref_vx, ref_vy, ref_vz, ref_psi: The reference of that instant.
        error_m: Between the two.
        p_cmd, q_cmd, r_cmd: Body rates commanded.
        thrust: The number that was sent, 0..1.
        thrust_n: What it stands for.
        thrust_scale: Thrust made, in parts of the one meant.
        push_x, push_y, push_z: Disturbance observed, m/s².
        fallback: What decided in place of a solved QP, as in flight.csv; -1 is none.
        sent: 1 where it was sent.
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
    """Errors on the track, gathered as they come: of the vehicle's own estimate, from the reference of its instant."""

    def __init__(self) -> None:
        """Begin without any."""
        self._of: list[tuple[float, float]] = []

    def add(self, track_s: float, reference_enu_m: Vector, position_enu_m: Vector) -> None:
        """Add one."""
        self._of.append((track_s, dist(reference_enu_m, position_enu_m)))

    def rmse_m(self, after_s: float = 0.0) -> float:
        """Return the RMS of those after a time along the track; nan where there are none."""
        errors = [error for track_s, error in self._of if track_s >= after_s]
        return sqrt(sum(error * error for error in errors) / len(errors)) if errors else nan

    @property
    def max_m(self) -> float:
        """The largest; nan where there are none."""
        return max((error for _, error in self._of), default=nan)

    @property
    def samples(self) -> int:
        """How many there are."""
        return len(self._of)

    @property
    def flown_s(self) -> float:
        """Time along the track at the last."""
        return self._of[-1][0] if self._of else 0.0


class FlightSummary:
    """What the rows of a flight come to.

    Attributes:
        sent: How many setpoints were sent.
        first_s, last_s: When, of the first and last row.
        max_tilt_rad: The largest tilt.
        max_age_s: Of the newest state, the largest while it flew.
        fallbacks: How many rows each fallback decided.
        phases: How long each phase sent setpoints, s.
    """

    def __init__(self) -> None:
        """Begin without a row."""
        self.sent = 0
        self.first_s = self.last_s = 0.0
        self.max_tilt_rad = self.max_age_s = 0.0
        self.fallbacks: Counter[Fallback] = Counter()
        self.phases: dict[str, float] = {}
        self._rows = 0

    @property
    def rate_hz(self) -> float:
        """How many setpoints were made a second."""
        return (self._rows - 1) / (self.last_s - self.first_s) if self.last_s > self.first_s else nan

    def add(self, row: LogRow) -> None:
        """Add a row."""
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
