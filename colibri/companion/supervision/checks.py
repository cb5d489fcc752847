"""Checks before a companion arms or takes over, each with advice for a failure."""

from collections.abc import Callable, Mapping
from math import hypot, inf, isfinite
from typing import NamedTuple

from colibri.companion.stack import Stack, TakeOffOrder, Thrust
from colibri.companion.supervision.limits import FlightLimits, FlightRegion, missing, too_old
from colibri.mavlink.client.clock import MAX_DRIFT
from colibri.mavlink.client.report import VehicleReport

MIN_STATE_RATE_HZ = 40.0
MAX_DELAY_S = 0.08
MIN_MODE_RATE_HZ = 8.0
START_BATTERY = 0.3
MAX_APPROACH_M = 50.0
MAX_HOME_M = 1.0
_MIN_HOVER, _MAX_HOVER = 0.05, 0.8


class CheckFacts(NamedTuple):
    """Facts before a flight."""

    stack: Stack
    systems: tuple[int, ...]
    home_moved_m: float
    thrust: Thrust | None
    parameters: Mapping[str, float] | None
    clock_known: bool
    clock_rate: float
    ages: Mapping[str, float]
    round_trip_s: float
    state_age_s: float
    state_rate_hz: float
    state_delay_s: float
    mode_rate_hz: float
    report: VehicleReport
    may_arm: bool
    approach_m: float
    contradiction: str
    box: FlightRegion
    limits: FlightLimits


class Check(NamedTuple):
    """A row of the table, with advice for a failure; one that is not `required` is only reported."""

    name: str
    passes: Callable[[CheckFacts], bool]
    action: Callable[[CheckFacts], str]
    required: bool = True


def _wrong_parameters(now: CheckFacts) -> list[str]:
    """Say which parameters are wrong, and which needed ones were not answered: their defaults are not assumed."""
    values = now.parameters
    if values is None:
        return []
    unread = [f"{name} was not answered: look at the link" for name in now.stack.needed if name not in values]
    rules = now.stack.rules
    return unread + [rule.action for rule in rules if rule.name in values and not rule.right(values[rule.name])]


def _clock_advice(now: CheckFacts) -> str:
    if "clock" not in now.ages:
        return "the vehicle answers no TIMESYNC: look at the link"
    if not _in_time(now):
        return (
            f"the vehicle's clock goes at {100 * now.clock_rate:.0f} % of this computer's: let a simulator fly at "
            "real time (colibri sitl --speed 1)"
        )
    return "too few TIMESYNC answers: wait, or check the link"


def _in_time(now: CheckFacts) -> bool:
    return abs(now.clock_rate - 1.0) <= MAX_DRIFT


def _climbs_above_sea(now: CheckFacts) -> bool:
    return now.may_arm and now.stack.take_off is TakeOffOrder.COMMAND_THEN_ARM


def _inside_fence(now: CheckFacts) -> bool:
    values = now.parameters or {}
    if values.get("FENCE_ENABLE", 1.0) == 0.0:
        return True
    radius_m, height_m = (values.get(name, 0.0) for name in now.stack.fence)
    (west, south, _), (east, north, up) = now.box
    farthest_m = max(hypot(x, y) for x in (west, east) for y in (south, north))
    return (radius_m <= 0.0 or farthest_m <= radius_m) and (height_m <= 0.0 or up <= height_m)


CHECKS: tuple[Check, ...] = (
    Check(
        "vehicle",
        lambda now: len(now.systems) == 1,
        lambda now: f"systems {', '.join(map(str, now.systems))} are on the link: choose one by --system",
    ),
    Check("clock", lambda now: now.clock_known and _in_time(now), _clock_advice),
    Check(
        "ages",
        lambda now: not too_old(now.ages, in_flight=False) and not missing(now.ages, needed=True),
        lambda now: "; ".join(
            too_old(now.ages, in_flight=False)
            + [f"the vehicle does not report {report}" for report in missing(now.ages, needed=True)]
        ),
    ),
    Check(
        "reports",
        lambda now: not missing(now.ages),
        lambda now: f"the vehicle does not report {', '.join(missing(now.ages))}: not checked",
        required=False,
    ),
    Check(
        "states",
        lambda now: now.state_rate_hz >= MIN_STATE_RATE_HZ and now.state_age_s <= now.limits.max_state_age_s,
        lambda now: (
            f"{now.state_rate_hz:.0f} states a second, {MIN_STATE_RATE_HZ:.0f} are needed, and the newest is "
            f"{1e3 * now.state_age_s:.0f} ms old, of at most {1e3 * now.limits.max_state_age_s:.0f}: raise the link's "
            "rate, or end other streams"
            if now.state_age_s < inf
            else "no time stamp yet: see the clock"
        ),
    ),
    Check(
        "consistency",
        lambda now: not now.contradiction,
        lambda now: f"the vehicle's {now.contradiction}: look at its estimator",
    ),
    Check(
        "delay",
        lambda now: now.state_delay_s <= MAX_DELAY_S and now.round_trip_s <= 2.0 * MAX_DELAY_S,
        lambda now: (
            f"states are {1e3 * now.state_delay_s:.0f} ms old, a round trip takes {1e3 * now.round_trip_s:.0f} ms: use "
            "a quicker link, a cable at best"
        ),
    ),
    Check(
        "modes",
        lambda now: now.mode_rate_hz >= MIN_MODE_RATE_HZ,
        lambda now: (
            f"the mode is reported {now.mode_rate_hz:.0f} times a second: the pilot's choice is obeyed that much later"
        ),
        required=False,
    ),
    Check("parameters", lambda now: now.parameters is not None, lambda _: "its parameters are not read yet"),
    Check("settings", lambda now: not _wrong_parameters(now), lambda now: "; ".join(_wrong_parameters(now))),
    Check(
        "hover thrust",
        lambda now: now.thrust is not None and _MIN_HOVER <= now.thrust.hover <= _MAX_HOVER,
        lambda _: "the hover thrust parameter is 0: hover once with its own autopilot",
    ),
    Check(
        "estimator",
        lambda now: now.report.estimator_ok is not False,
        lambda _: "the vehicle does not know where it is: wait for GPS, or look at its estimator",
    ),
    Check(
        "pre-arm",
        lambda now: now.report.armed or not now.may_arm or now.report.prearm_ok is not False,
        lambda _: "pre-arm checks of the vehicle fail: see its messages",
    ),
    Check(
        "altitude",
        lambda now: isfinite(now.report.altitude_amsl_m) or not _climbs_above_sea(now),
        lambda _: "the take-off needs the height above the sea (GLOBAL_POSITION_INT): wait for GPS",
    ),
    Check(
        "battery",
        lambda now: not now.report.battery < START_BATTERY,
        lambda now: f"{100 * now.report.battery:.0f} % are left, {100 * START_BATTERY:.0f} are needed: charge it",
    ),
    Check(
        "fence",
        lambda now: not now.report.fence_breached and _inside_fence(now),
        lambda _: "the track, with its margin, leads beyond the vehicle's fence: choose another, or move the fence",
    ),
    Check(
        "start",
        lambda now: not now.approach_m > MAX_APPROACH_M,
        lambda now: (
            f"the track begins {now.approach_m:.0f} m from the vehicle, at most {MAX_APPROACH_M:.0f} are flown to it: "
            "choose another, or take over nearer to it"
        ),
    ),
    Check(
        "home",
        lambda now: now.home_moved_m <= MAX_HOME_M,
        lambda now: f"home has moved by {now.home_moved_m:.1f} m since the mission was placed: start again",
    ),
)


def failing(now: CheckFacts, *, required: bool = True) -> list[str]:
    """Return name and advice of each failing check."""
    rows = (check for check in CHECKS if check.required == required)
    return [f"{check.name}: {check.action(now)}" for check in rows if not check.passes(now)]
