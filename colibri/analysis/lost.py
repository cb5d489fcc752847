"""Judge a flight by its true motion, and detect the loss of the vehicle."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.recording import INPUT, SETTLED_AFTER_S, FlightReader, Samples
from colibri.autopilot.control.interface import Active
from colibri.autopilot.guidance.landing_detector import HARD_M_S, HARD_UP
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan
from colibri.plant.vehicle.description import Vehicle

_ABOVE_GROUND_M = 0.1  # below a higher reference the ground must not be touched
_WINDOW_S = 1.0
_GRAVITY_M_S2 = 9.81


class FlightSeries:
    """A flight of n control samples and m = n - 1 decisions, as in a `Recording`.

    Attributes:
        moment_n_m: Norm of U2, U3 and U4, (n,).
        upright: Cosine of the tilt, (n,).
        contact_speed_m_s: Speed before each contact with the ground.
        swings_rad_s: Swing of the thrust axis in each second, by its end: the RMS of the rate of turn that the track
            does not explain, at most that of the rate.
        touches, aloft: Masks of samples on the ground, and with the reference above it, (n,).
    """

    def __init__(self, samples: int, vehicle: Vehicle) -> None:
        numbers = np.empty((6, samples))  # in one piece, which the system gets back as soon as the flight is judged
        self.t, self.position_error_m, self.moment_n_m, self.upright = numbers[:4]
        self.solve_time_us, self.control_step_us = numbers[4:, 1:]
        self.qp_iterations = np.empty(samples - 1, dtype=np.float32)  # exact: a QP takes 100,000 at most
        self.touches, self.aloft = np.empty((2, samples), dtype=np.bool_)
        self.qp_status, self.fallback = np.empty((2, samples - 1), dtype=np.int8)
        self.constrained = Active(*np.zeros(len(Active._fields), dtype=np.int64).tolist())
        self.max_slack = -np.inf
        self.contact_speed_m_s: dict[int, float] = {}
        self.swings_rad_s: dict[float, float] = {}
        self._last_speed = np.nan
        self.path_lag_s: float | None = None
        self.trajectory_sha256 = ""
        self._vehicle = vehicle
        self._samples = self._decisions = 0

    def add(self, part: Samples) -> None:
        at = slice(self._samples, self._samples + len(part.table))
        up = _up(part)
        self.swings_rad_s |= _swings(part)
        self.t[at] = part["t"]
        self.position_error_m[at] = part.position_error_m
        self.moment_n_m[at] = np.linalg.norm(part.columns(INPUT[1:]), axis=1)
        self.upright[at] = up[:, 2]
        self.touches[at] = _touches(self._vehicle, part["z"], up)
        speeds = np.append(self._last_speed, np.linalg.norm(part.columns(("u", "v", "w")), axis=1))
        touches = self.touches[max(at.start - 1, 0) : at.stop]
        for index in at.stop - len(touches) + np.flatnonzero(touches[1:] & ~touches[:-1]):
            self.contact_speed_m_s[int(index)] = float(speeds[index - at.start + 1])
        self._last_speed = speeds[-1]
        self.aloft[at] = part["z_ref"] > _ABOVE_GROUND_M
        self._samples = at.stop
        at = slice(self._decisions, self._decisions + len(part.slack))
        for name in ("solve_time_us", "control_step_us", "qp_iterations", "qp_status", "fallback"):
            getattr(self, name)[at] = getattr(part, name)
        self._decisions = at.stop
        active = np.count_nonzero(part.active, axis=0) + self.constrained
        self.constrained = Active(*active.tolist())
        self.max_slack = float(part.slack.max(initial=self.max_slack))


def read_flight(reader: FlightReader, *others: Callable[[Samples], None]) -> FlightSeries:
    series = FlightSeries(reader.samples, reader.plan.plant_vehicle)
    for part in reader:
        for add in (series.add, *others):
            add(part)
    series.path_lag_s, series.trajectory_sha256 = reader.path_lag_s, reader.trajectory_sha256
    return series


def _up(part: Samples) -> Array:
    phi, theta = part["phi"], part["theta"]
    return np.stack([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)], axis=1)


def _swings(part: Samples) -> dict[float, float]:
    t = part["t"]
    step_s = float(t[-1] - t[0]) / max(len(t) - 1, 1)
    window = max(round(_WINDOW_S / step_s), 2) if step_s else len(t)
    if len(t) < window + 2:
        return {}
    phi, theta, psi = (part[name] for name in ("phi", "theta", "psi"))
    east = np.cos(phi) * np.sin(theta) * np.cos(psi) + np.sin(phi) * np.sin(psi)
    north = np.cos(phi) * np.sin(theta) * np.sin(psi) - np.sin(phi) * np.cos(psi)
    rates = np.diff(np.stack([east, north, np.cos(phi) * np.cos(theta)], axis=1), axis=0)[1:-1] / step_s
    needed = np.diff(part.columns(("x_ref", "y_ref", "z_ref")), 2, axis=0) / (step_s * step_s)
    needed[:, 2] += _GRAVITY_M_S2
    needed /= np.linalg.norm(needed, axis=1, keepdims=True) + 1e-9
    departures = rates - np.diff(needed, axis=0) / step_s
    whole = len(rates) // window * window
    shape = (2, -1, window * 3)
    squares = np.square(np.stack([rates[:whole], departures[:whole]])).reshape(shape).sum(axis=2) / window
    return dict(zip(t[window : whole + 1 : window].tolist(), np.sqrt(squares.min(axis=0)).tolist(), strict=True))


def _touches(vehicle: Vehicle, z: Array, up: Array) -> NDArray[np.bool_]:
    if vehicle.ground is None:
        return np.zeros(len(z), dtype=np.bool_)
    heights = z[:, None] + up @ vehicle.contacts_m().T
    touches: NDArray[np.bool_] = heights.min(axis=1) <= vehicle.ground_height_m
    return touches


LOST_M = 5.0  # a settled vehicle further from its reference is lost
_TOUCHED_S = 1.0  # longest contact with the ground below the reference
_LAST_PART = 2.0 / 3.0
LIMIT_CYCLE_RAD_S = 1.5  # a swing above it is a limit cycle; rotors slower than assumed cause 3 to 8 rad/s
_TURNING_S = 1.0  # a recovery may be upside down for so long
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
