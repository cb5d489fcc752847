"""Flights that test a vehicle file, and how wrong its numbers may be.

Flights start in hover, most of them off the track. The error of a flight is its RMS over the last third.
"""

from collections.abc import Callable, Mapping
from math import nan, radians, sqrt, tan
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.lost import LIMIT_CYCLE_RAD_S
from colibri.analysis.outcome import fly_to_its_end
from colibri.autopilot.control.vehicle_model.battery import BatteryModel
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.campaigns.factors import SCALED, with_keys
from colibri.common.errors import Error
from colibri.conformance.subject import Result
from colibri.flights.plan import FlightPlan
from colibri.flights.spec import FlightSpec, Window
from colibri.mavlink.hil.feedback import Feedback
from colibri.plant.vehicle.description import Vehicle

HEIGHT_M, OFF_M = 12.0, 2.0
PART = 0.6
"""Acceleration of the lemniscate, in parts of the vehicle's."""
FAR_M = 2.0  # an error above it is a loss
_MAX_TILT_DEG = 65.0
EMPTY = 0.9  # charge taken, in parts of the capacity
HOVER = f"hover:height={HEIGHT_M:g}"


class Trial(NamedTuple):
    """A flight: its options for a vehicle, duration, usual error, start off the track, and tables it requires."""

    options: Callable[[Vehicle], dict[str, Any]]
    duration_s: float
    usual_m: float = 0.1
    off_m: float = OFF_M
    requires: tuple[str, ...] = ()


class Flown(NamedTuple):
    """A flown trial: `lost`, a word and the details, is empty if the vehicle flew it."""

    lost: str
    error_m: float
    swing_rad_s: float


def thrust_ratio(vehicle: Vehicle, used: float = 0.0) -> float:
    """Return the largest thrust, in parts of the weight, with a part of the battery's charge used."""
    charge_ah = used * vehicle.battery.capacity_ah if vehicle.battery else 0.0
    top, weight_n = BatteryModel(vehicle).max_common_speed(charge_ah), vehicle.body.mass_kg * vehicle.gravity_m_s2
    return float(vehicle.max_wrench()[0]) * top * top / weight_n


def acceleration_m_s2(vehicle: Vehicle) -> float:
    """Return the horizontal acceleration with a sagging battery, within a tilt of 65°."""
    ratio = thrust_ratio(vehicle)
    return vehicle.gravity_m_s2 * min(sqrt(max(ratio * ratio - 1.0, 0.01)), tan(radians(_MAX_TILT_DEG)))


def lemniscate(vehicle: Vehicle) -> str:
    """Return the lemniscate of 4 m, which takes 400 m/s² at a lap of 1 s."""
    return f"lemniscate:height={HEIGHT_M:g},lap={sqrt(400.0 / (PART * acceleration_m_s2(vehicle))):.2f}"


def emptied(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with a nearly empty battery."""
    battery = vehicle.battery
    assert battery is not None, "a trial that requires a battery"
    voltage_v = battery.full_voltage_v + EMPTY * (battery.empty_voltage_v - battery.full_voltage_v)
    top = vehicle.rotors.max_speed * voltage_v / battery.full_voltage_v
    return vehicle.replace("battery.full_voltage_v", voltage_v).replace("rotors.max_speed", top)


TRIALS = {
    "hover": Trial(lambda _: {"track": HOVER}, 6.0, off_m=0.0),
    "step of 4 m": Trial(lambda _: {"track": HOVER}, 8.0, off_m=4.0),
    "lemniscate": Trial(lambda vehicle: {"track": lemniscate(vehicle)}, 12.0),
    "wind of 8 m/s": Trial(
        lambda _: {"track": HOVER, "wind": "8@270", "turbulence": "light"}, 12.0, 0.5, 0.0, ("drag",)
    ),
    "10 % more mass": Trial(
        lambda v: {"track": HOVER, "plant_vehicle": v.replace("body.mass_kg", 1.1 * v.body.mass_kg)}, 12.0
    ),
    "empty battery": Trial(lambda vehicle: {"track": HOVER, "vehicle": emptied(vehicle)}, 8.0, requires=("battery",)),
    "sensors": Trial(
        lambda _: {"track": "hover:height=3", "feedback": "sensors"}, 14.0, 1.5, 0.0, ("sensors", "ground")
    ),
}
"""Flights with the vehicle's own numbers."""
WRONG_TRIALS = (
    Trial(lambda vehicle: {"track": HOVER, "plant_vehicle": vehicle}, 6.0),
    Trial(lambda vehicle: {"track": lemniscate(vehicle), "plant_vehicle": vehicle}, 10.0),
)
"""Flights with a wrong number."""
NUMBERS = {
    "mass": ("body.mass_kg",),
    "thrust coefficient": ("rotors.thrust_coefficient",),
    "rotor lag": ("rotors.lag.time_constant_up_s", "rotors.lag.time_constant_down_s"),
    "inertia": ("body.inertia_kg_m2", "body.inertia_products_kg_m2"),
    "arm": ("rotors.position_m",),
    "drag": ("drag.linear_n_s_m", "drag.rotor_coefficient"),
}
"""Keys of a vehicle file by number."""
MAX_FACTOR, WITHIN = 4.0, 1.1
_NEAR_FACTOR = 1.25  # a bound nearer to 1 is near


def fly(vehicle: Vehicle, trial: Trial, law: Mapping[str, Any], assumed: Vehicle | None = None) -> Flown:
    """Fly a trial, whose law may assume another vehicle."""
    window = Window(trial.duration_s * 2.0 / 3.0, trial.duration_s)
    try:
        options = {"vehicle": assumed or vehicle, "link": "direct", "window": window, **law, **trial.options(vehicle)}
        plan = FlightPlan.of(FlightSpec.of(**options, duration=trial.duration_s))
        if plan.spec.feedback is Feedback.STATE:
            x, y, z = position(plan.track, np.zeros(1))[0]
            start = {"x": x, "y": y - trial.off_m, "z": z, "rotors": vehicle.hover_rpm}
            plan = FlightPlan.of(FlightSpec.of(**options, duration=trial.duration_s, start=start))
        outcome = fly_to_its_end(plan)
    except Error as error:
        return Flown(f"refused: {error}", nan, nan)
    if outcome.report is None or outcome.error is not None:
        return Flown(f"lost: {outcome.lost}", nan, nan)
    report = outcome.report
    error_m, swing_rad_s, off_m = (
        report[key] or 0.0 for key in ("rmse_in_window_m", "limit_cycle_rad_s", "max_error_in_window_m")
    )
    reasons = (
        f"lost: {outcome.lost}" if outcome.lost else "",
        f"lost: {report['ground_hits']} ground hits" if report["ground_hits"] else "",
        f"lost: {off_m:.1f} m off its track" if off_m > FAR_M else "",
        f"swings: {swing_rad_s:.1f} rad/s" if swing_rad_s > LIMIT_CYCLE_RAD_S else "",
    )
    return Flown(next(filter(None, reasons), ""), error_m, swing_rad_s)


def has_number(vehicle: Vehicle, number: str) -> bool:
    table, name, *_ = NUMBERS[number][0].split(".")
    return getattr(vehicle, table) is not None and getattr(getattr(vehicle, table), name) is not None


class Bound(NamedTuple):
    """The largest deviation, file / truth, of a number that was flown, and what happens beyond; empty: nothing."""

    factor: float
    beyond: str

    def __str__(self) -> str:
        sign = "" if self.beyond else "≤ " if self.factor < 1.0 else "≥ "
        return f"{sign}{self.factor:.2f}"

    @property
    def how(self) -> str:
        """What happens beyond, in a word."""
        return self.beyond.partition(":")[0]


class Tolerance(NamedTuple):
    """How wrong a number may be: the smallest and the largest ratio of file and truth that was flown."""

    name: str
    least: Bound
    most: Bound

    @property
    def result(self) -> Result:
        return Result.NEAR if min(1.0 / self.least.factor, self.most.factor) < _NEAR_FACTOR else Result.OK

    @property
    def cells(self) -> tuple[str, ...]:
        return self.name, str(self.result), f"{self.least} to {self.most}", self.least.how, self.most.how


def bound_of(vehicle: Vehicle, number: str, most: float, law: Mapping[str, Any]) -> Bound:
    """Bisect for the largest factor on a number of the law's file, up to `most`, within 10 %."""

    def lost(factor: float) -> str:
        try:
            assumed = with_keys({f"vehicle.{key}{SCALED}": factor for key in NUMBERS[number]}, "vehicle", vehicle)
        except Error as error:
            return f"refused: {error}"
        return next(filter(None, (fly(vehicle, trial, law, assumed).lost for trial in WRONG_TRIALS)), "")

    if not (beyond := lost(most)):
        return Bound(most, "")
    flown, failed = 1.0, most
    while max(failed / flown, flown / failed) > WITHIN:
        middle = sqrt(flown * failed)
        if found := lost(middle):
            failed, beyond = middle, found
        else:
            flown = middle
    return Bound(flown, beyond)
