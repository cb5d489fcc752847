"""Truth and decisions of a flight, joined at control samples."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from hashlib import sha256
from math import isnan
from pathlib import Path, PurePath
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.logs import RecordingError, Rows, at_times, csv_rows, log_of, read_blocks, read_series
from colibri.autopilot.guidance.trajectories.tracks import position
from colibri.common import rotations
from colibri.common.compiled_rotations import euler_from_quaternion
from colibri.common.errors import checked
from colibri.common.jit import compiled
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan
from colibri.flights.provenance import plan_of
from colibri.mavlink.ulog.flight_topics import DECISION, MORE_TRUTH, TRUTH
from colibri.mavlink.ulog.log import TopicReader
from colibri.plant.vehicle.description import Vehicle

STATE = ("u", "v", "w", "p", "q", "r", "x", "y", "z", "phi", "theta", "psi")
INPUT = ("U1", "U2", "U3", "U4")
ATTITUDE_REFERENCE = ("phi_ref", "theta_ref", "psi_ref")
ROTORS = ("omega1", "omega2", "omega3", "omega4")
POSITION_REFERENCE = ("x_ref", "y_ref", "z_ref")
SETTLED_AFTER_S = 20.0  # from then on its start no longer counts
COLUMNS = ("t", *STATE, *INPUT, *ATTITUDE_REFERENCE, *ROTORS, *POSITION_REFERENCE)
_MORE_ROTORS = MORE_TRUTH.names[1:]

_PLANT_STATE = slice(1, 14)
_PLANT_ATTITUDE = slice(10, 14)
_PLANT_ROTORS = slice(14, 18)
_SAME_S = 1e-7
_nearest_turn = compiled(rotations.nearest_turn)


@dataclass(frozen=True, slots=True)
class Samples:
    """Consecutive control samples of a flight; the m decisions led to all rows but the first.

    Attributes:
        table: Columns as in `COLUMNS`, then those of more than four rotors, (n, 27 or more): a row holds the state at
            its time, the inputs that led to it, and their references.
        qp_status: As in `colibri.autopilot.control.interface.STATUS_CODES`, (m,).
        fallback: Source of a decision, as in `FALLBACK_CODES` there, (m,).
        slack: Planned excess of soft limits, in units of each, (m,).
        active: Active constraints of each kind, as in `Active` there, (m, 4).
        qp_iterations: nan if unknown, (m,).
    """

    table: Array
    qp_status: NDArray[np.int64]
    fallback: NDArray[np.int64]
    solve_time_us: Array
    control_step_us: Array
    slack: Array
    active: NDArray[np.int64]
    qp_iterations: Array

    def __getitem__(self, column: str) -> Array:
        """Return one column, (n,)."""
        return self.table[:, (COLUMNS + _MORE_ROTORS).index(column)]

    def columns(self, names: tuple[str, ...]) -> Array:
        """Return some columns, (n, len(names))."""
        return np.stack([self[name] for name in names], axis=1)

    @property
    def position_error_m(self) -> Array:
        """Distance to the reference of the instant or path time, (n,)."""
        error: Array = np.linalg.norm(self.columns(("x", "y", "z")) - self.columns(POSITION_REFERENCE), axis=1)
        return error


@dataclass(frozen=True, slots=True)
class Recording(Samples):
    """A flight in memory, 0.04 MB a simulated second at 125 Hz.

    Attributes:
        path_lag_s: Last lag of path time; `None` on the clock.
        trajectory_sha256: Hash of the plant's states at every frame, float64.
    """

    path_lag_s: float | None
    trajectory_sha256: str


class Lags(NamedTuple):
    """Lag of path time at each decision, s, (m,); nan on the clock."""

    decided_s: Array
    lag_s: Array

    def first(self, count: int) -> "Lags":
        return Lags(self.decided_s[:count], self.lag_s[:count])


class FlightReader:
    """Joins truth and decisions part by part, in some MB."""

    def __init__(self, plan: FlightPlan, log: TopicReader | None = None) -> None:
        """Read the times that join them, by default from the plan's folder.

        Raises:
            RecordingError: The log lacks a complete control sample.
            LogFormatError: The log is of another version.
        """
        self.plan = plan
        self.log = log_of(plan.out) if log is None else log
        (plant_s,) = read_series(self.log, TRUTH, "t")
        if not len(plant_s):
            raise RecordingError("the flight ended before it began")
        lags = read_lags(self.log)
        lags = lags.first(int(np.searchsorted(lags.decided_s, plant_s[-1])))
        decided_s = lags.decided_s  # of each control sample; the last one is held as long as the first
        held_s = decided_s[-1:] + (decided_s[1] - decided_s[0] if len(decided_s) > 1 else plant_s[-1])
        self._sampled = at_times(plant_s, np.concatenate([decided_s, held_s]))
        self.samples = int(np.count_nonzero(self._sampled))
        self._lags = lags.first(max(self.samples - 1, 0))
        if not len(self._lags.decided_s):
            raise RecordingError("the flight ended before its first control sample: give it a longer --duration")
        lag_s = float(self._lags.lag_s[-1])
        self.path_lag_s = None if isnan(lag_s) else lag_s
        self._states = sha256()

    @property
    def trajectory_sha256(self) -> str:
        """Complete after the last part."""
        return self._states.hexdigest()

    def __iter__(self) -> Iterator[Samples]:
        self._states = sha256()
        decided = Rows(self.log, DECISION)
        more = Rows(self.log, MORE_TRUTH) if self.plan.plant_vehicle.rotors.count > len(ROTORS) else None
        frames, yaw_rad, begins = 0, self.plan.start_yaw_rad, True
        for block in read_blocks(self.log, TRUTH):
            if more is not None:
                others = more.take(len(block))[:, 1:]
                block = np.hstack([block[: len(others)], others])  # the last may be missing
            sampled = self._sampled[frames : frames + len(block)]  # frames that were logged since then do not count
            frames += len(sampled)
            self._states.update(block[: len(sampled), _PLANT_STATE].tobytes())
            samples = block[: len(sampled)][sampled]
            if len(samples):
                part = self._part(samples, decided.take(len(samples) - begins), yaw_rad)
                yaw_rad, begins = float(part["psi"][-1]), False
                yield part

    def _part(self, samples: Array, decisions: Array, yaw_rad: float) -> Samples:
        start_reference = [0.0, 0.0, self.plan.start_yaw_rad]
        begins = len(decisions) < len(samples)
        count, rotors = self.plan.plant_vehicle.rotors.count, samples[:, _PLANT_ROTORS]
        if count != len(ROTORS):
            rotors = np.hstack([rotors, samples[:, len(TRUTH.names) :]])[:, :count]
        columns = [
            samples[:, :10],
            _euler(samples[:, _PLANT_ATTITUDE], yaw_rad),
            _inputs(self.plan.plant_vehicle, rotors),
            np.vstack([start_reference, decisions[:, 1:4]]) if begins else decisions[:, 1:4],
            samples[:, _PLANT_ROTORS],
            position(self.plan.track, path_times(samples[:, 0], self._lags)),
            rotors[:, len(ROTORS) :],
        ]
        return Samples(
            table=np.hstack(columns),
            qp_status=decisions[:, 4].astype(np.int64),
            fallback=decisions[:, 5].astype(np.int64),
            solve_time_us=decisions[:, 6],
            control_step_us=decisions[:, 7],
            slack=decisions[:, 9],
            active=decisions[:, 10:14].astype(np.int64),
            qp_iterations=decisions[:, 17],
        )


def read_recording(flight: FlightPlan | str | PurePath, log: TopicReader | None = None) -> Recording:
    """Return a recorded flight, by its folder or its plan."""
    checked("flight", flight, (str, PurePath, FlightPlan), "a folder or a FlightPlan", RecordingError)
    plan = flight if isinstance(flight, FlightPlan) else plan_of(Path(flight))
    reader = FlightReader(plan, log)
    parts = list(reader)
    whole = {each.name: np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Samples)}
    return Recording(**whole, path_lag_s=reader.path_lag_s, trajectory_sha256=reader.trajectory_sha256)


def read_lags(log: TopicReader) -> Lags:
    return Lags(*read_series(log, DECISION, "t", "path_lag_s"))


def path_times(times_s: Array, lags: Lags) -> Array:
    """Return path times, s, with the lag of the last decision."""
    rows = np.searchsorted(lags.decided_s, times_s + _SAME_S) - 1
    times: Array = times_s - np.nan_to_num(lags.lag_s[np.maximum(rows, 0)])
    return times


def columns_of(plan: FlightPlan) -> tuple[str, ...]:
    return COLUMNS + _MORE_ROTORS[: max(plan.plant_vehicle.rotors.count - len(ROTORS), 0)]


def rotor_names(plan: FlightPlan) -> tuple[str, ...]:
    return (ROTORS + _MORE_ROTORS)[: plan.plant_vehicle.rotors.count]


class TableWriter:
    def __init__(self, file: IO[bytes], plan: FlightPlan) -> None:
        self._file = file
        file.write((",".join(columns_of(plan)) + "\n").encode())

    def add(self, part: Samples) -> None:
        self._file.write(csv_rows(part.table))


def _inputs(vehicle: Vehicle, rotors: Array) -> Array:
    """Return thrust and moments of rotor speeds (n, m)."""
    squared = rotors**2
    if len(squared) == 1:  # a product with one row takes another way through BLAS, and its bits would be others
        squared = np.vstack([squared, squared])
    inputs: Array = squared @ vehicle.allocation().T
    return inputs[: len(rotors)]


@compiled
def _euler(quaternions: Array, yaw_rad: float) -> Array:
    """Return phi, theta and psi, (n, 3), psi continuous from `yaw_rad`."""
    angles = np.empty((len(quaternions), 3))
    for i in range(len(quaternions)):
        q = quaternions[i]
        angles[i, 0], angles[i, 1], psi = euler_from_quaternion((q[0], q[1], q[2], q[3]))
        yaw_rad = angles[i, 2] = _nearest_turn(psi, yaw_rad)
    return angles
