"""Whether a vehicle was lost, why and when: by where it truly was."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.series.flight_series import FlightSeries
from colibri.flights.plan import FlightPlan
from colibri.plant.vehicle.description import Vehicle

LOST_M = 5.0
"""A vehicle further off its reference once settled is lost."""
_TOUCHED_S = 1.0
"""Touching the ground for so long below its reference it is lost, though it may leave it again."""
_TURNING_S = 1.0
"""One that begins upside down may be so again for a moment while it recovers."""
_INSTANT_S = 1e-6


class Lost(NamedTuple):
    """A vehicle that was lost.

    Attributes:
        at_s: Simulated time at which that began.
        why: Where it was then and how, or what ended its flight.
    """

    at_s: float
    why: str


def lost(plan: FlightPlan, flight: FlightSeries) -> Lost | None:
    """Return why a vehicle was lost that flew until the end of its flight; None if it was not.

    It is if it lies or drags along the ground below its reference, if it ends upside down, or if it is further than
    `LOST_M` off its reference once settled; in a flight too short for that, if it ends that much further off than it
    began. Where ground stations command, the track is not what it shall fly, and it is never lost.
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
    """Return how long a vehicle touched the ground, s, after it had first left it; None where there is no ground."""
    return None if vehicle.ground is None else _lasted_s(_touches_again(flight), flight)


def _touches_again(flight: FlightSeries) -> NDArray[np.bool_]:
    """Return at which samples it touches the ground that it had left, (n,)."""
    again: NDArray[np.bool_] = flight.touches & np.logical_or.accumulate(~flight.touches)
    return again


def _lasted_s(holds: NDArray[np.bool_], flight: FlightSeries) -> float:
    return float(np.diff(flight.t, prepend=flight.t[0])[holds].sum())


def _grounded(flight: FlightSeries) -> int | None:
    """Return the sample at which a vehicle came down that should be higher; the first if it never took off."""
    if flight.touches.all():
        return 0 if flight.aloft[-1] else None
    down = _touches_again(flight) & flight.aloft
    stays = bool(down[-1]) or _lasted_s(down, flight) > _TOUCHED_S or flight.position_error_m[-1] > LOST_M
    return int(np.argmax(down)) if down.any() and stays else None


def _upside_down(flight: FlightSeries) -> int | None:
    """Return the sample since which a vehicle is upside down that began upright; one that did not may take a second."""
    t, upright = flight.t, flight.upright >= 0.0
    if upright[-1] or not upright.any():
        return None
    since = int(np.flatnonzero(upright)[-1]) + 1
    return since if upright[0] or t[-1] - t[since] > _TURNING_S else None


def _far_off(flight: FlightSeries) -> int | None:
    """Return the sample since which a vehicle is too far off its reference when that counts; None if it never is."""
    off_m = flight.position_error_m
    settled = flight.t >= SETTLED_AFTER_S - _INSTANT_S
    far = off_m > (LOST_M if settled.any() else off_m[0] + LOST_M)
    judged = np.flatnonzero(far & settled) if settled.any() else np.flatnonzero(far[-1:]) + len(far) - 1
    if not len(judged):
        return None
    near = np.flatnonzero(~far[: judged[0]])
    return int(near[-1]) + 1 if len(near) else 0
