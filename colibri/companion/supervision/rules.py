"""Checks before a companion arms or takes over, and limits that end its flight."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import hypot, inf, isfinite
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from colibri.autopilot.guidance.trajectories.tracks import Track, position
from colibri.common.types import Vector
from colibri.companion.stack import Stack, TakeOffOrder, Thrust
from colibri.mavlink.client.clock import MAX_DRIFT
from colibri.mavlink.client.report import VehicleReport

_MIN_STATE_RATE_HZ, _MAX_DELAY_S, _MIN_MODE_RATE_HZ = 40.0, 0.08, 8.0
_START_BATTERY = 0.3
_MAX_APPROACH_M, _MAX_HOME_M, _MAX_JUMP_M = 50.0, 1.0, 1.0
_MIN_HOVER, _MAX_HOVER = 0.05, 0.8
_TRACK_POINTS = 400
_ENDLESS_S = 100.0  # part of an endless track used for its box
CRITICAL = frozenset({5, 6, 7, 8})  # MAV_STATE_CRITICAL, EMERGENCY, POWEROFF and FLIGHT_TERMINATION


class Age(NamedTuple):
    """A report, its messages, and its largest age at the start and in flight, s; a `needed` one is required."""

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
    """Return the age of each report; `answered_us` is of the last TIMESYNC."""
    reported = report.reported_us if answered_us is None else {**report.reported_us, "clock": answered_us}
    return {name: (now_us - at_us) * 1e-6 for name, at_us in reported.items()}


def too_old(ages: Mapping[str, float], *, in_flight: bool) -> list[str]:
    """Say which reports are too old; `missing` names those never sent."""
    limits = ((row, row.flight_s if in_flight else row.start_s) for row in AGES)
    return [
        f"the last {row.name} report ({row.messages}) is {ages[row.name]:.1f} s old, more than {limit_s:g}"
        for row, limit_s in limits
        if ages.get(row.name, 0.0) > limit_s
    ]


def missing(ages: Mapping[str, float], *, needed: bool = False) -> list[str]:
    return [f"{row.name} ({row.messages})" for row in AGES if row.name not in ages and row.needed == needed]


class FlightRegion(NamedTuple):
    """Region of a flight, ENU, m."""

    lower: Vector
    upper: Vector

    def has(self, place: Vector) -> bool:
        return all(low <= x <= high for low, x, high in zip(self.lower, place, self.upper, strict=True))

    def around(self, place: Vector, margin_m: float) -> "FlightRegion":
        """Extend the box to a place and its margin."""
        lower = tuple(min(low, x - margin_m) for low, x in zip(self.lower, place, strict=True))
        upper = tuple(max(high, x + margin_m) for high, x in zip(self.upper, place, strict=True))
        return FlightRegion((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


_EVERYWHERE = FlightRegion((-inf, -inf, -inf), (inf, inf, inf))


def box_of(track: Track, duration_s: float, margin_m: float) -> FlightRegion:
    """Return the box around the flown part of a track."""
    points = position(track, np.linspace(0.0, min(track.duration_s, duration_s, _ENDLESS_S), _TRACK_POINTS))
    lower, upper = (points.min(axis=0) - margin_m).tolist(), (points.max(axis=0) + margin_m).tolist()
    return FlightRegion((lower[0], lower[1], lower[2]), (upper[0], upper[1], upper[2]))


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLimits:
    """Limits of a flight, each an option."""

    margin_m: float = 3.0
    max_tilt_deg: float = 50.0
    max_error_m: float = 1.5
    max_state_age_s: float = 0.1
    min_battery: float = 0.15
    min_pace: float = 0.8
    max_gap_s: float = 0.2


@dataclass(frozen=True, slots=True)
class FlightFacts:
    """Facts of a flight; `jumped_m` is the estimate's newest jump, `pace` the computed part of the last setpoints."""

    report: VehicleReport
    state_age_s: float = 0.0
    ages: Mapping[str, float] = field(default_factory=dict)
    contradiction: str = ""
    limits: FlightLimits = field(default_factory=FlightLimits)
    box: FlightRegion = _EVERYWHERE
    position_enu_m: Vector = (0.0, 0.0, 0.0)
    tilt_deg: float = 0.0
    error_m: float = 0.0
    jumped_m: float = 0.0
    law_error: str = ""
    pace: float = 1.0
    gap_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckFacts(FlightFacts):
    stack: Stack
    systems: tuple[int, ...]
    home_moved_m: float
    thrust: Thrust | None
    parameters: Mapping[str, float] | None
    clock_known: bool
    clock_rate: float
    round_trip_s: float
    state_rate_hz: float
    state_delay_s: float
    mode_rate_hz: float
    may_arm: bool
    approach_m: float

    @property
    def clock_in_time(self) -> bool:
        return abs(self.clock_rate - 1.0) <= MAX_DRIFT

    @property
    def wrong_parameters(self) -> list[str]:
        """Say which parameters are wrong, and which needed ones were not answered."""
        values = self.parameters
        if values is None:
            return []
        unread = [f"{name} was not answered: look at the link" for name in self.stack.needed if name not in values]
        rules = (rule for rule in self.stack.rules if rule.name in values)
        return unread + [rule.action for rule in rules if not rule.right(values[rule.name])]

    @property
    def inside_fence(self) -> bool:
        values = self.parameters or {}
        if values.get("FENCE_ENABLE", 1.0) == 0.0:
            return True
        radius_m, height_m = (values.get(name, 0.0) for name in self.stack.fence)
        (west, south, _), (east, north, up) = self.box
        farthest_m = max(hypot(x, y) for x in (west, east) for y in (south, north))
        return (radius_m <= 0.0 or farthest_m <= radius_m) and (height_m <= 0.0 or up <= height_m)


F = TypeVar("F", bound=FlightFacts)


class Rule(NamedTuple, Generic[F]):
    name: str
    broken: Callable[[F], bool]
    words: Callable[[F], str]  # what is wrong; of a check with advice
    required: bool = True  # whether a broken check prevents the flight
    blind: bool = False  # whether only the mode may be commanded after a limit


def _clock_advice(now: CheckFacts) -> str:
    if "clock" not in now.ages:
        return "the vehicle answers no TIMESYNC: look at the link"
    if now.clock_in_time:
        return "too few TIMESYNC answers: wait, or check the link"
    return (
        f"the vehicle's clock goes at {100 * now.clock_rate:.0f} % of this computer's: let a simulator fly at "
        "real time (colibri sitl --speed 1)"
    )


def _state_advice(now: CheckFacts) -> str:
    if now.state_age_s == inf:
        return "no time stamp yet: see the clock"
    return (
        f"{now.state_rate_hz:.0f} states a second, {_MIN_STATE_RATE_HZ:.0f} are needed, and the newest is "
        f"{1e3 * now.state_age_s:.0f} ms old, of at most {1e3 * now.limits.max_state_age_s:.0f}: raise the link's "
        "rate, or end other streams"
    )


def _age_advice(now: CheckFacts) -> str:
    never = [f"the vehicle does not report {report}" for report in missing(now.ages, needed=True)]
    return "; ".join(too_old(now.ages, in_flight=False) + never)


CHECKS: tuple[Rule[CheckFacts], ...] = (
    Rule(
        "vehicle",
        lambda now: len(now.systems) != 1,
        lambda now: f"systems {', '.join(map(str, now.systems))} are on the link: choose one by --system",
    ),
    Rule("clock", lambda now: not (now.clock_known and now.clock_in_time), _clock_advice),
    Rule("ages", lambda now: bool(_age_advice(now)), _age_advice),
    Rule(
        "reports",
        lambda now: bool(missing(now.ages)),
        lambda now: f"the vehicle does not report {', '.join(missing(now.ages))}: not checked",
        required=False,
    ),
    Rule(
        "states",
        lambda now: now.state_rate_hz < _MIN_STATE_RATE_HZ or now.state_age_s > now.limits.max_state_age_s,
        _state_advice,
    ),
    Rule(
        "consistency",
        lambda now: bool(now.contradiction),
        lambda now: f"the vehicle's {now.contradiction}: look at its estimator",
    ),
    Rule(
        "delay",
        lambda now: now.state_delay_s > _MAX_DELAY_S or now.round_trip_s > 2.0 * _MAX_DELAY_S,
        lambda now: (
            f"states are {1e3 * now.state_delay_s:.0f} ms old, a round trip takes {1e3 * now.round_trip_s:.0f} ms: use "
            "a quicker link, a cable at best"
        ),
    ),
    Rule(
        "modes",
        lambda now: now.mode_rate_hz < _MIN_MODE_RATE_HZ,
        lambda now: (
            f"the mode is reported {now.mode_rate_hz:.0f} times a second: the pilot's choice is obeyed that much later"
        ),
        required=False,
    ),
    Rule("parameters", lambda now: now.parameters is None, lambda _: "its parameters are not read yet"),
    Rule("settings", lambda now: bool(now.wrong_parameters), lambda now: "; ".join(now.wrong_parameters)),
    Rule(
        "hover thrust",
        lambda now: now.thrust is None or not _MIN_HOVER <= now.thrust.hover <= _MAX_HOVER,
        lambda _: "the hover thrust parameter is 0: hover once with its own autopilot",
    ),
    Rule(
        "estimator",
        lambda now: now.report.estimator_ok is False,
        lambda _: "the vehicle does not know where it is: wait for GPS, or look at its estimator",
    ),
    Rule(
        "pre-arm",
        lambda now: now.may_arm and not now.report.armed and now.report.prearm_ok is False,
        lambda _: "pre-arm checks of the vehicle fail: see its messages",
    ),
    Rule(
        "altitude",
        lambda now: (
            now.may_arm
            and now.stack.take_off is TakeOffOrder.COMMAND_THEN_ARM
            and not isfinite(now.report.altitude_amsl_m)
        ),
        lambda _: "the take-off needs the height above the sea (GLOBAL_POSITION_INT): wait for GPS",
    ),
    Rule(
        "battery",
        lambda now: now.report.battery < _START_BATTERY,
        lambda now: f"{100 * now.report.battery:.0f} % are left, {100 * _START_BATTERY:.0f} are needed: charge it",
    ),
    Rule(
        "fence",
        lambda now: now.report.fence_breached or not now.inside_fence,
        lambda _: "the track, with its margin, leads beyond the vehicle's fence: choose another, or move the fence",
    ),
    Rule(
        "start",
        lambda now: now.approach_m > _MAX_APPROACH_M,
        lambda now: (
            f"the track begins {now.approach_m:.0f} m from the vehicle, at most {_MAX_APPROACH_M:.0f} are flown to it: "
            "choose another, or take over nearer to it"
        ),
    ),
    Rule(
        "home",
        lambda now: now.home_moved_m > _MAX_HOME_M,
        lambda now: f"home has moved by {now.home_moved_m:.1f} m since the mission was placed: start again",
    ),
)

LIMITS: tuple[Rule[FlightFacts], ...] = (
    Rule(
        "late states",
        lambda now: now.state_age_s > now.limits.max_state_age_s,
        lambda now: (
            f"the newest state is {1e3 * now.state_age_s:.0f} ms old, more than {1e3 * now.limits.max_state_age_s:.0f}"
        ),
        blind=True,
    ),
    Rule(
        "contradiction",
        lambda now: bool(now.contradiction),
        lambda now: f"the vehicle's {now.contradiction}",
        blind=True,
    ),
    Rule(
        "estimate lost",
        lambda now: now.report.estimator_ok is False,
        lambda _: "the vehicle does not know its attitude, velocity or position any more",
        blind=True,
    ),
    Rule(
        "estimate jumped",
        lambda now: now.jumped_m > _MAX_JUMP_M,
        lambda now: f"the vehicle's estimate has jumped by {now.jumped_m:.1f} m",
        blind=True,
    ),
    Rule("control law", lambda now: bool(now.law_error), lambda now: now.law_error, blind=True),
    Rule(
        "stale reports",
        lambda now: bool(too_old(now.ages, in_flight=True)),
        lambda now: "; ".join(too_old(now.ages, in_flight=True)),
    ),
    Rule(
        "overloaded",
        lambda now: now.pace < now.limits.min_pace or now.gap_s > now.limits.max_gap_s,
        lambda now: (
            f"this computer is too slow for the control law: {100 * now.pace:.0f} % of the setpoints were sent in the "
            f"last second, of at least {100 * now.limits.min_pace:.0f}, and the last {1e3 * now.gap_s:.0f} ms ago, "
            f"of at most {1e3 * now.limits.max_gap_s:.0f}"
        ),
    ),
    Rule(
        "box",
        lambda now: not now.box.has(now.position_enu_m),
        lambda now: "the vehicle has left the box {:.0f} m around its track, at {:.1f}, {:.1f}, {:.1f} m".format(
            now.limits.margin_m, *now.position_enu_m
        ),
    ),
    Rule(
        "tilt",
        lambda now: now.tilt_deg > now.limits.max_tilt_deg,
        lambda now: f"the vehicle leans by {now.tilt_deg:.0f} degrees, more than {now.limits.max_tilt_deg:.0f}",
    ),
    Rule(
        "error",
        lambda now: now.error_m > now.limits.max_error_m,
        lambda now: f"the vehicle is {now.error_m:.2f} m from where it is to be, more than {now.limits.max_error_m:g}",
    ),
    Rule(
        "battery",
        lambda now: now.report.battery < now.limits.min_battery,
        lambda now: (
            f"{100 * now.report.battery:.0f} % of the battery are left, less than {100 * now.limits.min_battery:.0f}"
        ),
    ),
    Rule("fence", lambda now: now.report.fence_breached, lambda _: "the vehicle is beyond its fence"),
    Rule(
        "failsafe",
        lambda now: now.report.system_status in CRITICAL,
        lambda now: f"the vehicle reports an emergency (system status {now.report.system_status})",
    ),
)


def failing(now: CheckFacts, *, required: bool = True) -> list[str]:
    rows = (check for check in CHECKS if check.required == required)
    return [f"{check.name}: {check.words(now)}" for check in rows if check.broken(now)]


def exceeded(now: FlightFacts) -> Rule[FlightFacts] | None:
    return next((limit for limit in LIMITS if limit.broken(now)), None)
