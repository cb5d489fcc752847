"""What a flight is judged by, as arrays: of a control sample some 50 bytes, in place of its row in the table."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.recording import INPUT, FlightReader, Samples
from colibri.autopilot.control.interface import Active
from colibri.common.types import Array
from colibri.plant.vehicle.description import Vehicle

_ABOVE_GROUND_M = 0.1
"""A reference that is higher does not mean the vehicle to touch the ground."""


class FlightSeries:
    """A flight of n control samples and the m decisions between them, n = m + 1.

    Attributes:
        t: Times, s, (n,).
        position_error_m: Distance to the reference of the same instant, or of the path time then, (n,).
        moment_n_m: Norm of U2, U3 and U4, (n,).
        upright: Upright part of the body's z axis, the cosine of the tilt, (n,).
        touches: At which samples a foot or a rotor touches the ground, (n,).
        aloft: At which the reference is above the ground, (n,).
        solve_time_us: Time of each QP, (m,).
        control_step_us: Time of each control step, (m,).
        qp_iterations: That each QP's solver took; nan where there was none, or it does not say, (m,).
        qp_status: How each QP ended, as in `interface.STATUS_CODES`, (m,).
        fallback: What decided in its place, as in `interface.FALLBACK_CODES`, (m,).
        constrained: At how many samples constraints of each kind were active.
        max_slack: By how much soft limits were planned to be exceeded at most, in parts of each.
        path_lag_s: As of a `Recording`.
        trajectory_sha256: As of a `Recording`.
    """

    def __init__(self, samples: int, vehicle: Vehicle) -> None:
        """Take `samples` control samples of `vehicle`, part by part."""
        numbers = np.empty((6, samples))  # in one piece, which the system gets back as soon as the flight is judged
        self.t, self.position_error_m, self.moment_n_m, self.upright = numbers[:4]
        self.solve_time_us, self.control_step_us = numbers[4:, 1:]
        self.qp_iterations = np.empty(samples - 1, dtype=np.float32)  # exact: a QP takes 100,000 at most
        self.touches, self.aloft = np.empty((2, samples), dtype=np.bool_)
        self.qp_status, self.fallback = np.empty((2, samples - 1), dtype=np.int8)
        self.constrained = Active(*np.zeros(len(Active._fields), dtype=np.int64).tolist())
        self.max_slack = -np.inf
        self.path_lag_s: float | None = None
        self.trajectory_sha256 = ""
        self._vehicle = vehicle
        self._samples = self._decisions = 0

    def add(self, part: Samples) -> None:
        """Append the next samples."""
        at = slice(self._samples, self._samples + len(part.table))
        up = _up(part)
        self.t[at] = part["t"]
        self.position_error_m[at] = part.position_error_m
        self.moment_n_m[at] = np.linalg.norm(part.columns(INPUT[1:]), axis=1)
        self.upright[at] = up[:, 2]
        self.touches[at] = _touches(self._vehicle, part["z"], up)
        self.aloft[at] = part["z_ref"] > _ABOVE_GROUND_M
        self._samples = at.stop
        at = slice(self._decisions, self._decisions + len(part.slack))
        self.solve_time_us[at] = part.solve_time_us
        self.control_step_us[at] = part.control_step_us
        self.qp_iterations[at] = part.qp_iterations
        self.qp_status[at] = part.qp_status
        self.fallback[at] = part.fallback
        self._decisions = at.stop
        active = np.count_nonzero(part.active, axis=0) + self.constrained
        self.constrained = Active(*active.tolist())
        self.max_slack = float(part.slack.max(initial=self.max_slack))


def read_flight(reader: FlightReader, *others: Callable[[Samples], None]) -> FlightSeries:
    """Return the series of a flight; `others` are handed each part of it, too."""
    series = FlightSeries(reader.samples, reader.plan.plant_vehicle)
    for part in reader:
        for add in (series.add, *others):
            add(part)
    series.path_lag_s, series.trajectory_sha256 = reader.path_lag_s, reader.trajectory_sha256
    return series


def _up(part: Samples) -> Array:
    """Return the vertical in the body's frame, (n, 3)."""
    phi, theta = part["phi"], part["theta"]
    return np.stack([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)], axis=1)


def _touches(vehicle: Vehicle, z: Array, up: Array) -> NDArray[np.bool_]:
    """Return at which samples a foot or a rotor touches the ground, by its height and the vertical, (n,)."""
    if vehicle.ground is None:
        return np.zeros(len(z), dtype=np.bool_)
    heights = z[:, None] + up @ vehicle.ground.contacts_m(vehicle.rotors).T
    touches: NDArray[np.bool_] = heights.min(axis=1) <= vehicle.ground_height_m
    return touches
