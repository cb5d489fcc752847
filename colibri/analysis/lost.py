"""Detect the loss of a vehicle, from its true motion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.series.flight_series import FlightSeries
from colibri.autopilot.guidance.landing_detector import HARD_M_S, HARD_UP
from colibri.flights.plan import FlightPlan
from colibri.plant.vehicle.description import Vehicle

LOST_M = 5.0
"""A settled vehicle further from its reference is lost."""
_TOUCHED_S = 1.0
"""Longest contact with the ground below the reference."""
_LAST_PART = 2.0 / 3.0
LIMIT_CYCLE_RAD_S = 1.5
"""A swing above it is a limit cycle; rotors slower than assumed cause 3 to 8 rad/s."""
_TURNING_S = 1.0
"""A recovery may be upside down for so long."""
_INSTANT_S = 1e-6


class Lost(NamedTuple):
    """A loss: simulated time of its beginning, and its description."""

    at_s: float
    why: str


def lost(plan: FlightPlan, flight: FlightSeries) -> Lost | None:
    """Judge a completed flight; one under ground stations is never lost.

    A vehicle is lost if it lies or drags along the ground below its reference, ends upside down, or is further than
    `LOST_M` from its reference once settled; in a short flight, if it ends that much further away than it began.
    """
    if plan.spec.gcs:
        return None
    began = [at for at in (_grounded(flight), _upside_down(flight), _far_off(flight)) if at is not None]
    if not began:
        return None
    at = min(began)
    off_m, t, touches = flight.position_error_m, flight.t, flight.touches
    tilt_deg = np.degrees(np.arccos(np.clip(flight.upright[at], -1.0, 1.0)))
    how = f"{off_m[at]:.1f} m off its track, tilted {tilt_deg:.0f}°"
    later = f"; later up to {off_m[at:].max():.1f} m off"
    if touches[at]:
        return Lost(float(t[at]), f"on the ground, {how}{later}")
    down = np.flatnonzero(touches[at:])
    crash = f", on the ground at t = {t[at + down[0]]:.2f} s" if len(down) else ""
    return Lost(float(t[at]), f"in the air, {how}{later}{crash}")


def ground_contact_s(vehicle: Vehicle, flight: FlightSeries) -> float | None:
    """Return the time on the ground after the first lift-off."""
    return None if vehicle.ground is None else _lasted_s(_touches_again(flight), flight)


def ground_hits(vehicle: Vehicle, flight: FlightSeries) -> int | None:
    """Count contacts with the ground below a reference in the air."""
    if vehicle.ground is None:
        return None
    hits = _touches_again(flight) & flight.aloft
    return int(np.count_nonzero(hits[1:] & ~flight.touches[:-1]))


def limit_cycle_rad_s(flight: FlightSeries) -> float | None:
    """Return the swing of the thrust axis over the last third: the median RMS of a second."""
    swings = [swing for at_s, swing in flight.swings_rad_s.items() if at_s > _LAST_PART * flight.t[-1]]
    return float(np.median(swings)) if swings else None


def impact(flight: FlightSeries) -> str | None:
    """Describe the hardest contact with the ground that is no landing."""
    down = _touches_again(flight)
    speeds = {at: speed for at, speed in flight.contact_speed_m_s.items() if down[at + 1]}
    hard = [at for at, speed in speeds.items() if speed > HARD_M_S or flight.upright[at] < HARD_UP]
    if not hard:
        return None
    at = max(hard, key=lambda each: speeds[each])
    tilt_deg = np.degrees(np.arccos(np.clip(flight.upright[at], -1.0, 1.0)))
    return f"at {speeds[at]:.1f} m/s, tilted {tilt_deg:.0f}°, at t = {flight.t[at]:.2f} s"


def _touches_again(flight: FlightSeries) -> NDArray[np.bool_]:
    again: NDArray[np.bool_] = flight.touches & np.logical_or.accumulate(~flight.touches)
    return again


def _lasted_s(holds: NDArray[np.bool_], flight: FlightSeries) -> float:
    return float(np.diff(flight.t, prepend=flight.t[0])[holds].sum())


def _grounded(flight: FlightSeries) -> int | None:
    if flight.touches.all():
        return 0 if flight.aloft[-1] else None
    down = _touches_again(flight) & flight.aloft
    stays = bool(down[-1]) or _lasted_s(down, flight) > _TOUCHED_S or flight.position_error_m[-1] > LOST_M
    return int(np.argmax(down)) if down.any() and stays else None


def _upside_down(flight: FlightSeries) -> int | None:
    t, upright = flight.t, flight.upright >= 0.0
    if upright[-1] or not upright.any():
        return None
    since = int(np.flatnonzero(upright)[-1]) + 1
    return since if upright[0] or t[-1] - t[since] > _TURNING_S else None


def _far_off(flight: FlightSeries) -> int | None:
    off_m = flight.position_error_m
    settled = flight.t >= SETTLED_AFTER_S - _INSTANT_S
    far = off_m > (LOST_M if settled.any() else off_m[0] + LOST_M)
    judged = np.flatnonzero(far & settled) if settled.any() else np.flatnonzero(far[-1:]) + len(far) - 1
    if not len(judged):
        return None
    near = np.flatnonzero(~far[: judged[0]])
    return int(near[-1]) + 1 if len(near) else 0
