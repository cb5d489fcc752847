"""Estimation errors of a flight against the truth, and tracking errors by the estimate."""

from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.consistency import NAVIGATION, Errors
from colibri.analysis.recording import RecordingError, path_times, read_columns, read_csv
from colibri.autopilot.estimation.measurements.table import KINDS
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.rotations import earth_from_body, euler_from_quaternion, nearest_turn, rotation_matrix
from colibri.common.types import Array, Vector
from colibri.flights.plan import FlightPlan

FIGURES = ("control_rmse_m", "estimation_rmse_m", "attitude_rmse_deg", "nees_mean", "nis_mean")
MEASURED = KINDS
"""Each kind of measurement that there is, and how many numbers it has; a vehicle need not have all."""
_UPPER = np.triu_indices(NAVIGATION)
_COVARIANCE = slice(11, 56)


class Estimation(NamedTuple):
    """Errors of the estimate at every control sample, and of the filter ten times a second.

    Attributes:
        t: Time of each control sample, s, (n,).
        position_m: Estimated less true, ENU, (n, 3).
        attitude_rad: Roll, pitch and yaw, estimated less true, (n, 3).
        control_m: Distance of the estimate from the reference, (n,).
        deviation: Standard deviations that the estimator claims: of position (m) and attitude (rad), (n, 6).
        checked_s: Times of the filter, (m,).
        nees: Its normalised estimation error squared at them: position, velocity and attitude together, (m,).
        nis: Sums of the normalised innovations squared up to them, a column for each of `kinds`, (m, k).
        accepted: How many innovations these are, (m, k).
        kinds: What of `MEASURED` the vehicle has, k names.
    """

    t: Array
    position_m: Array
    attitude_rad: Array
    control_m: Array
    deviation: Array
    checked_s: Array
    nees: Array
    nis: Array
    accepted: Array
    kinds: tuple[str, ...]

    def after(self, start_s: float) -> "Estimation":
        """Return what there is from `start_s` on."""
        late, checked = self.t >= start_s, self.checked_s >= start_s
        return self._replace(
            t=self.t[late],
            position_m=self.position_m[late],
            attitude_rad=self.attitude_rad[late],
            control_m=self.control_m[late],
            deviation=self.deviation[late],
            checked_s=self.checked_s[checked],
            nees=self.nees[checked],
            nis=self.nis[checked],
            accepted=self.accepted[checked],
        )

    def figures(self) -> dict[str, Any]:
        """Return the root mean squares that a report has, and mean NEES and NIS; None if it ended too early for them.

        NIS is given in parts of the number of numbers: 1 if the errors match the covariance.
        """
        if not len(self.t):
            return dict.fromkeys(FIGURES)
        horizontal = np.hypot(self.position_m[:, 0], self.position_m[:, 1])
        angles = np.degrees(self.attitude_rad)
        values = (
            rms(self.control_m),
            {"horizontal": rms(horizontal), "vertical": rms(self.position_m[:, 2])},
            {name: rms(angles[:, axis]) for axis, name in enumerate(("roll", "pitch", "yaw"))},
            float(self.nees.mean()),
            self._mean_nis(),
        )
        return dict(zip(FIGURES, values, strict=True))

    def _mean_nis(self) -> dict[str, dict[str, float | None]]:
        sums, counts = self.nis[-1] - self.nis[0], self.accepted[-1] - self.accepted[0]
        return {
            kind: {"mean": total / count / MEASURED[kind] if count > 0 else None, "innovations": max(int(count), 0)}
            for kind, total, count in zip(self.kinds, sums.tolist(), counts.tolist(), strict=True)
        }


def read_estimation(plan: FlightPlan) -> Estimation:
    """Compare a flight's `estimate.csv` and `filter.csv` with its `plant.csv`.

    Raises:
        RecordingError: Nothing was estimated.
    """
    truth = read_csv(plan.out / "plant.csv")
    said = _within(read_csv(plan.out / "estimate.csv"), truth)
    if not len(said):
        raise RecordingError("the flight ended before there was an estimate")
    real = _at(truth, said[:, 0])
    off = said[:, 1:4] - real[:, 7:10]
    angles = [
        _angles_off(estimated, true)
        for estimated, true in zip(said[:, 7:11].tolist(), real[:, 10:14].tolist(), strict=True)
    ]
    columns = read_columns(plan.out / "filter.csv")
    kinds = tuple(kind for kind in MEASURED if f"nis_{kind}" in columns)
    checks = _within(read_csv(plan.out / "filter.csv"), truth)
    return Estimation(
        t=said[:, 0],
        position_m=off,
        attitude_rad=np.array(angles),
        control_m=np.linalg.norm(
            said[:, 1:4] - position(plan.track, path_times(said[:, 0], read_csv(plan.out / "autopilot.csv"))), axis=1
        ),
        deviation=said[:, [14, 15, 16, 20, 21, 22]],
        checked_s=checks[:, 0],
        nees=np.array(
            [_errors(check, real).nees() for check, real in zip(checks, _at(truth, checks[:, 0]), strict=True)]
        ),
        nis=checks[:, [columns.index(f"nis_{kind}") for kind in kinds]],
        accepted=checks[:, [columns.index(f"believed_{kind}") for kind in kinds]],
        kinds=kinds,
    )


def _within(log: Array, truth: Array) -> Array:
    """Return the rows of instants that the plant has logged."""
    return log[np.isin(np.round(log[:, 0] * 1e6), np.round(truth[:, 0] * 1e6))]


def _at(truth: Array, times_s: Array) -> Array:
    return truth[np.searchsorted(np.round(truth[:, 0] * 1e6), np.round(times_s * 1e6))]


def _angles_off(estimated: list[float], true: list[float]) -> Vector:
    ew, ex, ey, ez = estimated
    tw, tx, ty, tz = true
    said, real = euler_from_quaternion((ew, ex, ey, ez)), euler_from_quaternion((tw, tx, ty, tz))
    return (said[0] - real[0], said[1] - real[1], nearest_turn(said[2], real[2]) - real[2])


def _errors(check: Array, real: Array) -> Errors:
    """Return true less estimated; attitude as a rotation vector in the estimated body frame."""
    u, v, w, _, _, _, *place = real[1:10].tolist()
    rw, rx, ry, rz = real[10:14].tolist()
    ew, ex, ey, ez = check[7:11].tolist()
    turn = np.array(rotation_matrix((ew, ex, ey, ez))).T @ np.array(rotation_matrix((rw, rx, ry, rz)))
    small = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    velocity = np.array(earth_from_body((rw, rx, ry, rz), (u, v, w)))
    covariance = np.zeros((NAVIGATION, NAVIGATION))
    covariance[_UPPER] = check[_COVARIANCE]
    covariance = covariance + np.triu(covariance, 1).T
    return Errors(np.concatenate([place - check[1:4], velocity - check[4:7], small]), covariance)


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
