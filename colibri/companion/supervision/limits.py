"""Ages of the reports and limits that end a flight, each as one table."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import dist, inf
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from colibri.autopilot.guidance.trajectories.tracks import Track, position
from colibri.common.types import Vector
from colibri.mavlink.client.report import VehicleReport


class Age(NamedTuple):
    """A row of the table: a report, its messages, and its largest age at the start and in flight, s.

    A vehicle that never sends a `needed` one is not flown.
    """

    name: str
    messages: str
    start_s: float
    flight_s: float
    needed: bool = False


AGES: tuple[Age, ...] = (
    Age("clock", "TIMESYNC", 1.0, 3.0),
    Age("heartbeat", "HEARTBEAT", 5.0, 5.0),
    Age("mode", "CURRENT_MODE or HEARTBEAT", 2.5, 2.5),
    Age("estimator", "ESTIMATOR_STATUS or SYS_STATUS", 2.0, 3.0),
    Age("status", "SYS_STATUS", 3.0, 5.0),
    Age("battery", "SYS_STATUS or BATTERY_STATUS", 5.0, 10.0),
    Age("landed", "EXTENDED_SYS_STATE", 2.0, inf, needed=True),
    Age("altitude", "GLOBAL_POSITION_INT", 2.0, inf),
)
"""Age of states (attitude, body rates, position, velocity): `FlightLimits.max_state_age_s`."""


def ages_s(report: VehicleReport, answered_us: int | None, now_us: int) -> dict[str, float]:
    """Return the age of each report that the vehicle has sent; `answered_us` is of the last TIMESYNC."""
    reported = report.reported_us if answered_us is None else {**report.reported_us, "clock": answered_us}
    return {name: (now_us - at_us) * 1e-6 for name, at_us in reported.items()}


def too_old(ages: Mapping[str, float], *, in_flight: bool) -> list[str]:
    """Say which reports are too old. One that was never sent is not: see `missing` and `needed`."""
    limits = ((row, row.flight_s if in_flight else row.start_s) for row in AGES)
    return [
        f"the last {row.name} report ({row.messages}) is {ages[row.name]:.1f} s old, more than {limit_s:g}"
        for row, limit_s in limits
        if ages.get(row.name, 0.0) > limit_s
    ]


def missing(ages: Mapping[str, float], *, needed: bool = False) -> list[str]:
    return [f"{row.name} ({row.messages})" for row in AGES if row.name not in ages and row.needed == needed]


MAX_STATE_AGE_S = 0.1
MIN_BATTERY = 0.15
MIN_PACE = 0.8
MAX_GAP_S = 0.2
_TRACK_POINTS = 400
_ENDLESS_S = 100.0
"""Part of an endless track used for its box."""
CRITICAL = frozenset({5, 6, 7, 8})
"""MAV_STATE_CRITICAL, EMERGENCY, POWEROFF and FLIGHT_TERMINATION."""


class FlightRegion(NamedTuple):
    """Region of a flight, ENU, m."""

    lower: Vector
    upper: Vector

    def has(self, place: Vector) -> bool:
        return all(low <= x <= high for low, x, high in zip(self.lower, place, self.upper, strict=True))

    @classmethod
    def at(cls, place: Vector, margin_m: float) -> "FlightRegion":
        return cls(place, place).around(place, margin_m)

    def around(self, place: Vector, margin_m: float) -> "FlightRegion":
        """Extend the box to a place and its margin."""
        lower = tuple(min(low, x - margin_m) for low, x in zip(self.lower, place, strict=True))
        upper = tuple(max(high, x + margin_m) for high, x in zip(self.upper, place, strict=True))
        return FlightRegion((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


def box_of(track: Track, duration_s: float, margin_m: float) -> FlightRegion:
    """Return the box around the flown part of a track."""
    points = position(track, np.linspace(0.0, min(track.duration_s, duration_s, _ENDLESS_S), _TRACK_POINTS))
    lower, upper = (points.min(axis=0) - margin_m).tolist(), (points.max(axis=0) + margin_m).tolist()
    return FlightRegion((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """Limits of a flight, each an option of the command line."""

    margin_m: float = 3.0
    max_tilt_deg: float = 50.0
    max_error_m: float = 1.5
    max_state_age_s: float = MAX_STATE_AGE_S
    min_battery: float = MIN_BATTERY
    min_pace: float = MIN_PACE
    max_gap_s: float = MAX_GAP_S


class FlightFacts(NamedTuple):
    """Facts of a flight.

    Attributes:
        jumped_m: Jump of the estimate at the newest state.
        pace: Computed part of the last second's setpoints.
    """

    report: VehicleReport
    state_age_s: float = 0.0
    position_enu_m: Vector = (0.0, 0.0, 0.0)
    tilt_deg: float = 0.0
    reference_enu_m: Vector | None = None
    jumped_m: float = 0.0
    law_error: str = ""
    pace: float = 1.0
    gap_s: float = 0.0
    ages: Mapping[str, float] = MappingProxyType({})
    contradiction: str = ""


class Limit(NamedTuple):
    """A row of the table; after a `blind` one only the mode may be commanded."""

    name: str
    exceeded: Callable[[FlightFacts, FlightLimits, FlightRegion], bool]
    words: Callable[[FlightFacts, FlightLimits], str]
    blind: bool = False


MAX_JUMP_M = 1.0

LIMITS: tuple[Limit, ...] = (
    Limit(
        "late states",
        lambda now, limits, _: now.state_age_s > limits.max_state_age_s,
        lambda now, limits: (
            f"the newest state is {1e3 * now.state_age_s:.0f} ms old, more than {1e3 * limits.max_state_age_s:.0f}"
        ),
        blind=True,
    ),
    Limit(
        "contradiction",
        lambda now, _limits, _box: bool(now.contradiction),
        lambda now, _limits: f"the vehicle's {now.contradiction}",
        blind=True,
    ),
    Limit(
        "estimate lost",
        lambda now, _limits, _box: now.report.estimator_ok is False,
        lambda _now, _limits: "the vehicle does not know its attitude, velocity or position any more",
        blind=True,
    ),
    Limit(
        "estimate jumped",
        lambda now, _limits, _box: now.jumped_m > MAX_JUMP_M,
        lambda now, _limits: f"the vehicle's estimate has jumped by {now.jumped_m:.1f} m",
        blind=True,
    ),
    Limit(
        "control law",
        lambda now, _limits, _box: bool(now.law_error),
        lambda now, _limits: now.law_error,
        blind=True,
    ),
    Limit(
        "stale reports",
        lambda now, _limits, _box: bool(too_old(now.ages, in_flight=True)),
        lambda now, _limits: "; ".join(too_old(now.ages, in_flight=True)),
    ),
    Limit(
        "overloaded",
        lambda now, limits, _: now.pace < limits.min_pace or now.gap_s > limits.max_gap_s,
        lambda now, limits: (
            f"overloaded: {100 * now.pace:.0f} % of the setpoints in the last second, of at least "
            f"{100 * limits.min_pace:.0f}, and the last {1e3 * now.gap_s:.0f} ms ago, of at most "
            f"{1e3 * limits.max_gap_s:.0f}"
        ),
    ),
    Limit(
        "box",
        lambda now, _limits, box: not box.has(now.position_enu_m),
        lambda now, limits: (
            "the vehicle has left the box {:.0f} m around its track, at {:.1f}, {:.1f}, {:.1f} m".format(
                limits.margin_m, *now.position_enu_m
            )
        ),
    ),
    Limit(
        "tilt",
        lambda now, limits, _: now.tilt_deg > limits.max_tilt_deg,
        lambda now, limits: f"the vehicle leans by {now.tilt_deg:.0f} degrees, more than {limits.max_tilt_deg:.0f}",
    ),
    Limit(
        "error",
        lambda now, limits, _: (
            now.reference_enu_m is not None and dist(now.reference_enu_m, now.position_enu_m) > limits.max_error_m
        ),
        lambda now, limits: (
            f"the vehicle is {dist(now.reference_enu_m or now.position_enu_m, now.position_enu_m):.2f} m from where it "
            f"is to be, more than {limits.max_error_m:g}"
        ),
    ),
    Limit(
        "battery",
        lambda now, limits, _: now.report.battery < limits.min_battery,
        lambda now, limits: (
            f"{100 * now.report.battery:.0f} % of the battery are left, less than {100 * limits.min_battery:.0f}"
        ),
    ),
    Limit(
        "fence",
        lambda now, _limits, _box: now.report.fence_breached,
        lambda _now, _limits: "the vehicle is beyond its fence",
    ),
    Limit(
        "failsafe",
        lambda now, _limits, _box: now.report.system_status in CRITICAL,
        lambda now, _limits: f"the vehicle reports an emergency (system status {now.report.system_status})",
    ),
)


def exceeded(now: FlightFacts, limits: FlightLimits, box: FlightRegion) -> Limit | None:
    return next((limit for limit in LIMITS if limit.exceeded(now, limits, box)), None)
