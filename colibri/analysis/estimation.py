"""Errors of a flight's estimate against the truth and its covariance: NEES and NIS against the bounds of χ².

Y. Bar-Shalom, X. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, section 5.4.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from colibri.analysis.logs import RecordingError, Rows, at_times, read_blocks, read_series
from colibri.analysis.recording import path_times, read_lags
from colibri.autopilot.estimation.measurements.table import KINDS, kinds_of
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.rotations import earth_from_body, euler_from_quaternion, nearest_turn, rotation_matrix
from colibri.common.types import Array, Vector
from colibri.flights.plan import FlightPlan
from colibri.mavlink.ulog.flight_topics import ESTIMATE, FILTER, TRUTH, Topic
from colibri.mavlink.ulog.log import TopicReader

NAVIGATION = 9  # position, velocity, attitude


class Errors(NamedTuple):
    """True minus estimated position, m, velocity, m/s, ENU, and attitude, rad, body; covariance (9, 9)."""

    error: Array
    covariance: Array

    def nees(self, first: int = 0, count: int = NAVIGATION) -> float:
        """Return the normalised estimation error squared of a part."""
        part = slice(first, first + count)
        return float(self.error[part] @ np.linalg.solve(self.covariance[part, part], self.error[part]))


def bounds(numbers: int, flights: int, level: float = 0.95) -> tuple[float, float]:
    """Return bounds of the mean of χ² over `flights`."""
    from scipy.special import chdtri  # slow to load, and scipy.stats, which has it too, slower: a report does without

    lower, upper = (float(chdtri(numbers * flights, above)) for above in (0.5 + 0.5 * level, 0.5 - 0.5 * level))
    return lower / flights, upper / flights


FIGURES = ("control_rmse_m", "estimation_rmse_m", "attitude_rmse_deg", "nees_mean", "nis_mean")
MEASURED = KINDS  # components of each kind of measurement
_UPPER = np.triu_indices(NAVIGATION)
_COVARIANCE = slice(11, 56)


class Estimation(NamedTuple):
    """Errors of the estimate at n control samples, and of the filter at m checks."""

    position_m: Array  # estimated minus true, ENU, (3, n)
    attitude_rad: Array  # estimated minus true, roll, pitch, yaw, (3, n)
    control_m: Array  # distance from the reference, (n,)
    nees: Array  # of position, velocity and attitude, (m,)
    nis: Array  # cumulative, by `kinds`, (k, m)
    accepted: Array  # innovations, cumulative, (k, m)
    kinds: tuple[str, ...]

    def figures(self) -> dict[str, Any]:
        """Return RMS values, and mean NEES and NIS."""
        if not len(self.control_m) or not len(self.nees):
            return dict.fromkeys(FIGURES)
        x, y, z = self.position_m
        axes = zip(("roll", "pitch", "yaw"), self.attitude_rad, strict=True)
        values = (
            rms(self.control_m),
            {"horizontal": rms(np.hypot(x, y)), "vertical": rms(z)},
            {name: rms(np.degrees(angles)) for name, angles in axes},
            float(self.nees.mean()),
            self._mean_nis(),
        )
        return dict(zip(FIGURES, values, strict=True))

    def _mean_nis(self) -> dict[str, dict[str, float | None]]:
        sums, counts = self.nis[:, -1] - self.nis[:, 0], self.accepted[:, -1] - self.accepted[:, 0]
        return {
            kind: {"mean": total / count / MEASURED[kind] if count > 0 else None, "innovations": max(int(count), 0)}
            for kind, total, count in zip(self.kinds, sums.tolist(), counts.tolist(), strict=True)
        }


def read_estimation(plan: FlightPlan, log: TopicReader, start_s: float) -> Estimation:
    """Compare estimate and filter from `start_s` on with the truth."""
    errors = _read_errors(plan, log, start_s)
    if not errors.size and not any(_beside_truth(log, ESTIMATE, -np.inf)):
        raise RecordingError("the flight ended before there was an estimate")
    sensors = plan.vehicle.sensors
    kinds = tuple(kinds_of(sensors)) if sensors else ()
    sums, counts = ([FILTER.names.index(f"{what}_{kind}") for kind in kinds] for what in ("nis", "believed"))
    nees, nis, accepted = np.split(_read_checks(log, start_s, [*sums, *counts]), [1, 1 + len(kinds)])
    return Estimation(errors[:3], errors[3:6], errors[6], nees[0], nis, accepted, kinds)


def _read_errors(plan: FlightPlan, log: TopicReader, start_s: float) -> Array:
    """Return errors of position and attitude, and distance to the reference, (7, n)."""
    parts, lags = [np.empty((7, 0))], read_lags(log)
    for said, true in _beside_truth(log, ESTIMATE, start_s):
        attitudes = zip(said[:, 7:11].tolist(), true[:, 10:14].tolist(), strict=True)
        angles = np.array([_angles_off(estimated, real) for estimated, real in attitudes])
        off_m = np.linalg.norm(said[:, 1:4] - position(plan.track, path_times(said[:, 0], lags)), axis=1)
        parts.append(np.vstack([(said[:, 1:4] - true[:, 7:10]).T, angles.T, off_m]))
    return np.concatenate(parts, axis=1)


def _read_checks(log: TopicReader, start_s: float, columns: list[int]) -> Array:
    """Return the NEES of each check, and some columns, (1 + columns, m)."""
    parts = [np.empty((1 + len(columns), 0))]
    for checks, truth in _beside_truth(log, FILTER, start_s):
        nees = [_errors(check, true).nees() for check, true in zip(checks, truth, strict=True)]
        parts.append(np.vstack([nees, checks[:, columns].T]))
    return np.concatenate(parts, axis=1)


def _beside_truth(log: TopicReader, topic: Topic, start_s: float) -> Iterator[tuple[Array, Array]]:
    """Yield blocks of a topic and of the truth at the same instants."""
    (said_s,), (true_s,) = (read_series(log, each, "t") for each in (topic, TRUTH))
    late = said_s >= start_s
    truth = Rows(log, TRUTH, at_times(true_s, said_s[late]))
    for said in read_blocks(log, topic, late & at_times(said_s, true_s)):
        yield said, truth.take(len(said))


def _angles_off(estimated: list[float], true: list[float]) -> Vector:
    said, real = (euler_from_quaternion((w, x, y, z)) for w, x, y, z in (estimated, true))
    return (said[0] - real[0], said[1] - real[1], nearest_turn(said[2], real[2]) - real[2])


def _errors(check: Array, real: Array) -> Errors:
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
    return float(np.sqrt(np.mean(values**2)))
