"""One flight of a study: how it is flown, and the figures of merit of what came of it."""

from dataclasses import dataclass
from math import isnan, nan

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.logs import read_series
from colibri.analysis.lost import LOST_M
from colibri.analysis.recording import SETTLED_AFTER_S, Recording, read_recording
from colibri.autopilot.control.interface import FALLBACK_CODES, Fallback
from colibri.campaigns.definition import Point
from colibri.campaigns.flights import Common, plan_point
from colibri.common.errors import InFlightError
from colibri.common.types import Array
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan
from colibri.mavlink.ulog.flight_topics import TRUTH
from colibri.mavlink.ulog.log import MemoryLog

_AWAY_M = 200.0
_GROUNDED_M = 0.1
"""No study flies so low; a vehicle on its back lies as high as one on its feet, or a little lower."""
_SAMPLE_TIME_S = 1e-6


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight that was flown.

    Attributes:
        recording: What it left behind.
        rotor_limits: Least rotor speed, and the largest that the battery allows at each sample, (n,), both in the
            vehicle's unit.
        failure: Why it ended early; None if it did not.
    """

    recording: Recording
    rotor_limits: tuple[float, Array]
    failure: str | None

    @property
    def t(self) -> Array:
        """Times, s, (n,)."""
        return self.recording["t"]

    @property
    def upright(self) -> Array:
        """Upright part of the body's z axis, the cosine of the tilt, (n,)."""
        cosine: Array = np.cos(self.recording["phi"]) * np.cos(self.recording["theta"])
        return cosine

    @property
    def tilt_deg(self) -> Array:
        """Angle between the body's z axis and the vertical, degrees, (n,)."""
        angle: Array = np.degrees(np.arccos(np.clip(self.upright, -1.0, 1.0)))
        return angle

    @property
    def settled(self) -> NDArray[np.bool_]:
        """At which samples the start no longer counts, (n,)."""
        after: NDArray[np.bool_] = self.t >= SETTLED_AFTER_S - _SAMPLE_TIME_S
        return after

    @property
    def rms_m(self) -> float:
        """RMS of the position error once settled, m; not a number for a flight too short."""
        error = self.recording.position_error_m[self.settled]
        return float(np.sqrt(np.mean(error**2))) if len(error) else nan

    @property
    def max_error_m(self) -> float:
        """Largest position error once settled, m; not a number for a flight too short."""
        error = self.recording.position_error_m[self.settled]
        return float(error.max()) if len(error) else nan

    @property
    def lost(self) -> bool:
        """Whether it ended early, or ended up far off its reference."""
        return self.failure is not None or (not isnan(self.max_error_m) and self.max_error_m > LOST_M)

    @property
    def crashed(self) -> bool:
        """Whether it ended early, came down to the ground, or flew away."""
        came_down = float(self.recording["z"].min()) < _GROUNDED_M
        return self.failure is not None or came_down or float(self.recording.position_error_m.max()) > _AWAY_M

    @property
    def height_lost_m(self) -> float:
        """How far it sank below where it began, m."""
        return float(self.recording["z"][0] - self.recording["z"].min())

    def decided_by(self, fallback: Fallback) -> NDArray[np.bool_]:
        """Return at which control samples `fallback` decided, (m,)."""
        decided: NDArray[np.bool_] = self.recording.fallback == FALLBACK_CODES[fallback]
        return decided

    def stays_below(self, values: Array, bound: float) -> float:
        """Return the time, s, from which `values` (n,) stay below `bound`; not a number if they do not."""
        above = np.flatnonzero(values >= bound)
        first = above[-1] + 1 if len(above) else 0
        return float(self.t[first]) if first < len(values) else nan


def fly(common: Common, point: Point) -> Flown:
    """Fly a flight of a campaign and return what came of it, also when it ended early; leave no files."""
    plan = plan_point(common, point)
    log, failure = MemoryLog(), None
    try:
        fly_locally(plan, topics=log)
    except InFlightError as error:
        failure = str(error)
    recording = read_recording(plan, log)
    limits = (plan.vehicle.rotors.idle_speed, _top_speed(plan, log, recording["t"]))
    return Flown(recording, limits, failure)


def _top_speed(plan: FlightPlan, log: MemoryLog, t: Array) -> Array:
    """Return the largest rotor speed, which is proportional to the battery's voltage, at times `t` (n,)."""
    vehicle = plan.plant_vehicle
    if vehicle.battery is None:
        return np.full_like(t, vehicle.rotors.max_speed)
    time_s, voltage_v = read_series(log, TRUTH, "t", "voltage_v")
    voltage_v[0] = vehicle.battery.full_voltage_v  # not known before the first step
    speed: Array = vehicle.rotors.max_speed * np.interp(t, time_s, voltage_v) / vehicle.battery.full_voltage_v
    return speed
