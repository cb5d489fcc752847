"""What a flight left behind: the logs of plant and autopilot, joined into one row a control sample."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common.errors import InFlightError
from colibri.common.rotations import euler_from_quaternion, nearest_turn
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan

STATE = ("u", "v", "w", "p", "q", "r", "x", "y", "z", "phi", "theta", "psi")
INPUT = ("U1", "U2", "U3", "U4")
ATTITUDE_REFERENCE = ("phi_ref", "theta_ref", "psi_ref")
ROTORS = ("omega1", "omega2", "omega3", "omega4")
POSITION_REFERENCE = ("x_ref", "y_ref", "z_ref")
SETTLED_AFTER_S = 20.0
"""From then on the start of a flight no longer counts."""
COLUMNS = ("t", *STATE, *INPUT, *ATTITUDE_REFERENCE, *ROTORS, *POSITION_REFERENCE)

_PLANT_STATE = slice(1, 14)
_PLANT_ATTITUDE = slice(10, 14)
_PLANT_ROTORS = slice(14, 18)
_LAG = 16
_SAME_S = 1e-7


class RecordingError(InFlightError):
    """The logs hold no flight."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A flight, one row a control sample.

    Attributes:
        table: Columns as in `COLUMNS`, (n, 27). Row k holds the state at its time and the inputs that led to it, with
            the references they were computed for; row 0 the start.
        qp_status: How each QP ended, as in `colibri.autopilot.control.interface.STATUS_CODES`, (m,).
        fallback: What decided in its place, as in `colibri.autopilot.control.interface.FALLBACK_CODES`, (m,).
        solve_time_us: Time of each QP, (m,).
        control_step_us: Time of each control step, (m,).
        slack: By how much soft limits were planned to be exceeded, in parts of each, (m,).
        active: How many constraints of each kind were active, columns as in `interface.Active`, (m, 4).
        path_lag_s: By which path time was last behind the clock; None for a control law that keeps to the clock.
        trajectory_sha256: Hash of the plant's states at every frame, as float64.
    """

    table: Array
    qp_status: NDArray[np.int64]
    fallback: NDArray[np.int64]
    solve_time_us: Array
    control_step_us: Array
    slack: Array
    active: NDArray[np.int64]
    path_lag_s: float | None
    trajectory_sha256: str

    def __getitem__(self, column: str) -> Array:
        """Return one column, (n,)."""
        return self.table[:, COLUMNS.index(column)]

    def columns(self, names: tuple[str, ...]) -> Array:
        """Return some columns, (n, len(names))."""
        return np.stack([self[name] for name in names], axis=1)

    @property
    def position_error_m(self) -> Array:
        """Distance to the reference of the same instant, or of the path time then, (n,)."""
        error: Array = np.linalg.norm(self.columns(("x", "y", "z")) - self.columns(POSITION_REFERENCE), axis=1)
        return error


def read_recording(plan: FlightPlan) -> Recording:
    """Join the logs in the plan's folder.

    Raises:
        RecordingError: There is no complete control sample in them.
    """
    plant = read_csv(plan.out / "plant.csv")
    autopilot = read_csv(plan.out / "autopilot.csv")
    if not len(plant):
        raise RecordingError("the flight ended before it began")
    decisions = autopilot[: np.searchsorted(autopilot[:, 0], plant[-1, 0])]
    samples = _at_samples(plant, decisions[:, 0])
    decisions = decisions[: max(len(samples) - 1, 0)]
    if not len(decisions):
        raise RecordingError("the flight ended before its first control sample: give it a longer --duration")
    return Recording(
        table=_join(plan, samples, decisions),
        qp_status=decisions[:, 4].astype(np.int64),
        fallback=decisions[:, 5].astype(np.int64),
        solve_time_us=decisions[:, 6],
        control_step_us=decisions[:, 7],
        slack=decisions[:, 9],
        active=decisions[:, 10:14].astype(np.int64),
        path_lag_s=None if np.isnan(decisions[-1, _LAG]) else float(decisions[-1, _LAG]),
        trajectory_sha256=sha256(np.ascontiguousarray(plant[:, _PLANT_STATE]).tobytes()).hexdigest(),
    )


def path_times(times_s: Array, decisions: Array) -> Array:
    """Return the path time at each time, s: it lags behind the clock as it did in the last of the decisions, (m, k)."""
    rows = np.searchsorted(decisions[:, 0], times_s + _SAME_S) - 1
    times: Array = times_s - np.nan_to_num(decisions[np.maximum(rows, 0), _LAG])
    return times


def write_recording(recording: Recording, path: Path) -> None:
    """Write the table as CSV; numbers keep every bit."""
    rows = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in recording.table.tolist())]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _at_samples(plant: Array, decided_s: Array) -> Array:
    """Return the plant's rows at the times of the decisions, and one where the last of them has been held."""
    held_s = decided_s[-1:] + (decided_s[1] - decided_s[0] if len(decided_s) > 1 else plant[-1, 0])
    times_us = np.round(np.concatenate([decided_s, held_s]) * 1e6)
    return plant[np.isin(np.round(plant[:, 0] * 1e6), times_us)]


def _join(plan: FlightPlan, samples: Array, decisions: Array) -> Array:
    squared = samples[:, _PLANT_ROTORS] ** 2
    start_reference = [0.0, 0.0, plan.start_yaw_rad]
    return np.hstack(
        [
            samples[:, :10],
            _euler(samples[:, _PLANT_ATTITUDE], plan.start_yaw_rad),
            squared @ plan.plant_vehicle.allocation().T,
            np.vstack([start_reference, decisions[:, 1:4]]),
            samples[:, _PLANT_ROTORS],
            position(plan.track, path_times(samples[:, 0], decisions)),
        ]
    )


def _euler(quaternions: Array, start_yaw_rad: float) -> Array:
    """Return phi, theta and psi, (n, 3), psi by continuity from the start."""
    angles = []
    yaw = start_yaw_rad
    for qw, qx, qy, qz in quaternions.tolist():
        phi, theta, psi = euler_from_quaternion((qw, qx, qy, qz))
        yaw = nearest_turn(psi, yaw)
        angles.append((phi, theta, yaw))
    return np.array(angles)


def read_columns(path: Path) -> list[str]:
    """Return the names of a log's columns."""
    with path.open(encoding="utf-8") as log:
        return log.readline().rstrip("\n").split(",")


def read_csv(path: Path) -> Array:
    """Return the complete rows of a log; a process that was killed may leave half of one."""
    header, *lines = path.read_text(encoding="utf-8").split("\n")
    complete = [line for line in lines[:-1] if line.count(",") == header.count(",")]
    values = [[float(value) for value in line.split(",")] for line in complete]
    return np.array(values).reshape(len(values), header.count(",") + 1)
