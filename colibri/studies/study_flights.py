"""One flight of a study, and its figures of merit."""

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
"""A vehicle on its back is lower than that."""
_SAMPLE_TIME_S = 1e-6


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight; rotor limits are the least speed, and the largest by voltage, (n,)."""

    recording: Recording
    rotor_limits: tuple[float, Array]
    failure: str | None

    @property
    def t(self) -> Array:
        return self.recording["t"]

    @property
    def upright(self) -> Array:
        """Cosine of the tilt, (n,)."""
        cosine: Array = np.cos(self.recording["phi"]) * np.cos(self.recording["theta"])
        return cosine

    @property
    def tilt_deg(self) -> Array:
        """Angle between the body's z axis and the vertical, (n,)."""
        angle: Array = np.degrees(np.arccos(np.clip(self.upright, -1.0, 1.0)))
        return angle

    @property
    def settled(self) -> NDArray[np.bool_]:
        after: NDArray[np.bool_] = self.t >= SETTLED_AFTER_S - _SAMPLE_TIME_S
        return after

    @property
    def rms_m(self) -> float:
        """RMS of the settled error; nan in a short flight."""
        error = self.recording.position_error_m[self.settled]
        return float(np.sqrt(np.mean(error**2))) if len(error) else nan

    @property
    def max_error_m(self) -> float:
        error = self.recording.position_error_m[self.settled]
        return float(error.max()) if len(error) else nan

    @property
    def lost(self) -> bool:
        return self.failure is not None or (not isnan(self.max_error_m) and self.max_error_m > LOST_M)

    @property
    def crashed(self) -> bool:
        """Whether it ended early, came down, or flew away."""
        came_down = float(self.recording["z"].min()) < _GROUNDED_M
        return self.failure is not None or came_down or float(self.recording.position_error_m.max()) > _AWAY_M

    @property
    def height_lost_m(self) -> float:
        return float(self.recording["z"][0] - self.recording["z"].min())

    def decided_by(self, fallback: Fallback) -> NDArray[np.bool_]:
        decided: NDArray[np.bool_] = self.recording.fallback == FALLBACK_CODES[fallback]
        return decided

    def stays_below(self, values: Array, bound: float) -> float:
        """Return when `values` (n,) stay below `bound` for good; nan if never."""
        above = np.flatnonzero(values >= bound)
        first = above[-1] + 1 if len(above) else 0
        return float(self.t[first]) if first < len(values) else nan


def fly(common: Common, point: Point) -> Flown:
    """Fly in memory, also a flight that ends early."""
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
    vehicle = plan.plant_vehicle
    if vehicle.battery is None:
        return np.full_like(t, vehicle.rotors.max_speed)
    time_s, voltage_v = read_series(log, TRUTH, "t", "voltage_v")
    voltage_v[0] = vehicle.battery.full_voltage_v  # not known before the first step
    speed: Array = vehicle.rotors.max_speed * np.interp(t, time_s, voltage_v) / vehicle.battery.full_voltage_v
    return speed
