"""A setpoint as message and as row of the log, and totals of rows."""

from collections import Counter, namedtuple
from math import acos, cos, dist, nan, sqrt
from typing import Any

from colibri.autopilot.control.interface import FALLBACK_CODES, Fallback
from colibri.autopilot.ground.snapshots import first
from colibri.common.rotations import euler_from_quaternion, quaternion_from_euler
from colibri.common.types import Array, Vector
from colibri.companion.settings import SetpointKind
from colibri.companion.steering import predictor as model
from colibri.companion.steering.law_pilot import LawDemand
from colibri.companion.steering.predictor import Predictor
from colibri.mavlink.client.conversation import Encoded
from colibri.mavlink.client.setpoints import attitude_target, position_target

LogRow = namedtuple(
    "LogRow",
    "t phase on_track track_s state_age_s round_trip_s x y z vx vy vz phi theta psi p q r "
    "ref_x ref_y ref_z ref_vx ref_vy ref_vz ref_psi error_m p_cmd q_cmd r_cmd thrust thrust_n thrust_scale "
    "push_x push_y push_z fallback sent",
)
"""A setpoint and its inputs at the time of effect, s on the companion's clock, m, rad, ENU and FLU.

`thrust`, 0..1, stands for `thrust_n`; `push_*` is the disturbance, m/s²; `fallback` is as in flight.csv.
"""


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
    """Totals: sent setpoints, rows by fallback, seconds by phase."""

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


_PULL_1_S = 1.0  # gain of the position error in a velocity setpoint


def message_of(
    kind: SetpointKind,
    now_us: int,
    target: tuple[int, int],
    asked: LawDemand,
    decided: LawDemand | None,
    thrust: float,
    y: Array,
) -> Encoded:
    """Return name and fields of a setpoint; `decided` is the last decision on references."""
    if kind is SetpointKind.RATES or decided is None or decided.reference is None or decided.decision is None:
        return attitude_target(target, rates=asked.rate_flu_rad_s, thrust=thrust, time_us=now_us)
    if kind is SetpointKind.ATTITUDE:
        attitude = quaternion_from_euler(*decided.decision.attitude_reference)
        return attitude_target(target, attitude, thrust=thrust, time_us=now_us)
    reference = decided.reference
    place, velocity = first(reference.position_enu_m), first(reference.velocity_enu_m_s)
    acceleration, yaw = first(reference.acceleration_enu_m_s2), float(reference.yaw_rad[0])
    if kind is SetpointKind.POSITION:
        return position_target(target, place, velocity, acceleration, yaw, time_us=now_us)
    here = first(y[None, model.POSITION])
    vx, vy, vz = (v + _PULL_1_S * (p - at) for v, p, at in zip(velocity, place, here, strict=True))
    return position_target(target, velocity=(vx, vy, vz), yaw=yaw, time_us=now_us)


def row_of(
    head: tuple[float, str, float, float],
    asked: LawDemand,
    decided: LawDemand,
    thrust: float,
    y: Array,
    predictor: Predictor,
    *,
    sent: bool,
) -> LogRow:
    """Return a row; `head` is time, phase, age of the state and round trip, s."""
    time_s, phase, state_age_s, round_trip_s = head
    assert decided.reference is not None, "a law has decided"
    reference, place = decided.reference, first(y[None, model.POSITION])
    wanted = first(reference.position_enu_m)
    fallback = decided.decision.diagnostics.fallback if decided.decision else None
    euler = euler_from_quaternion(tuple(y[model.ATTITUDE].tolist()))
    numbers: tuple[Any, ...] = (
        *(time_s, phase, int(decided.track_enu_m is not None), decided.track_s, state_age_s, round_trip_s),
        *(*place, *y[model.VELOCITY].tolist(), *euler, *y[model.RATE].tolist()),
        *(*wanted, *first(reference.velocity_enu_m_s), float(reference.yaw_rad[0]), dist(place, wanted)),
        *(*asked.rate_flu_rad_s, thrust, asked.thrust_n, predictor.thrust_scale),
        *(*predictor.disturbance[:3].tolist(), FALLBACK_CODES[fallback], int(sent)),
    )
    return LogRow(*numbers)
