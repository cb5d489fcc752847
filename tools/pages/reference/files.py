"""The tables of `files.md`: columns of each log, and keys of `report.json`, as the code that writes them has them."""

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from inspect import getsource
from pathlib import Path
from typing import Any

from colibri.analysis.estimation import FIGURES
from colibri.analysis.recording import COLUMNS
from colibri.analysis.report import report
from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES
from colibri.autopilot.estimation.measurements.table import kinds_of
from colibri.autopilot.process.logs import DECISION_COLUMNS, ESTIMATE_COLUMNS, check_columns
from colibri.plant.process.logs import TRUTH_COLUMNS
from colibri.plant.vehicle.description import load_vehicle
from tools.pages.tables import renew_tables

_MANY = 6
_AXIS = r"([xyz])"
_MEANINGS: tuple[tuple[str, str, str], ...] = (
    ("t", "s", "simulated time"),
    (r"[uvw]", "m/s", "velocity in the body's axes, FLU"),
    (r"[pqr]", "rad/s", "body rates, FLU"),
    (_AXIS, "m", "position, ENU"),
    (r"v([xyz])", "m/s", "velocity, ENU"),
    (r"q([wxyz])", "", "attitude as a quaternion, wxyz, FLU to ENU"),
    (r"(phi|theta|psi)", "rad", "attitude, angles Z-Y'-X''; yaw unwrapped"),
    (r"U1", "N", "thrust of all rotors"),
    (r"U[234]", "N m", "moments about the body's axes, FLU"),
    (r"(phi|theta|psi)_ref", "rad", "attitude that is steered to"),
    (r"([xyz])_ref", "m", "reference of the same instant, ENU"),
    (r"omega\d", "the vehicle's", "speed of each rotor, in the unit of the vehicle file"),
    (r"voltage_v", "V", "of the battery under load; `nan` without one"),
    (r"charge_ah", "Ah", "taken from the battery"),
    (r"wind_(east|north|up)", "m/s", "wind at the vehicle, turbulence and gusts in it"),
    (r"solve_time_us", "µs", "of the QP, by the clock: not the same again"),
    (r"control_step_us", "µs", "from frame to command, by the clock: not the same again"),
    (r"cost", "", "of the plan"),
    (r"slack", "parts", "by how much soft limits were planned to be exceeded, in parts of each"),
    (r"active_(rotors|increments|angles|rates)", "", "constraints of the kind that the plan touches"),
    (r"delay_us", "µs", "from frame to effect of its command, as compensated"),
    (r"mass_kg", "kg", "that the control law estimates; `nan` for one that estimates none"),
    (r"path_lag_s", "s", "by which path time lags behind the clock; `nan` for a law that keeps to the clock"),
    (r"qp_iterations", "", "of the QP's solver; `nan` where it does not say"),
    (r"sd_[xyz]", "m", "standard deviation of the position"),
    (r"sd_v[xyz]", "m/s", "standard deviation of the velocity"),
    (r"sd_(east|north|up)", "rad", "standard deviation of the attitude, about each axis of ENU"),
    (r"gyro_bias_[xyz]", "rad/s", "estimated bias of the gyroscope, FLU"),
    (r"accel_bias_[xyz]", "m/s²", "estimated bias of the accelerometer, FLU"),
    (r"flags", "", "bits of ESTIMATOR_STATUS_FLAGS: what is known well enough"),
    (r"rejected", "", "measurements rejected so far"),
    (r"resets", "", "times that part of the state was taken anew"),
    (r"P\d\d", "", "covariance of the error of position, velocity and attitude: its upper triangle, row by row"),
    (r"nis_\w+", "", "normalised innovations squared since the start, summed, of each kind of measurement"),
    (r"believed_\w+", "", "how many measurements were accepted since the start"),
)
_REPORT: dict[str, str] = {
    "track": "as it was asked for",
    "track_note": "what was done to a path through waypoints before it was flown",
    "profile": "by name",
    "controller": "control law, by name",
    "link": "`udp`, `memory` or `direct`",
    "seed": "of everything random",
    "feedback": "`state` or `sensors`",
    "solver": "QP solver, by name; null for a law without QP",
    "vehicle": "that the autopilot was told of",
    "plant_vehicle": "that flew",
    "integrator": "of the plant",
    "wind": "m/s, and degrees that it blew from",
    "gusts": "on top of it",
    "turbulence": "on top of it; null: none",
    "without": "parts left out of the plant's vehicle",
    "start": "how the flight began; m, degrees, m/s, rad/s, rpm",
    "sim_time_s": "simulated time flown, s",
    "lost": "why the vehicle was lost; null if it was not",
    "lost_at_s": "when, s; null if it was not",
    "ground_contact_s": "how long it touched the ground after it had left it, s",
    "wall_time_s": "by the clock, s",
    "real_time_factor": "simulated time over that",
    "rmse_m": "distance to the reference of the same instant, RMS, m",
    "max_error_m": "the largest, m",
    "rmse_after_20s_m": "RMS from 20 s on, m; null for a shorter flight",
    "max_error_after_20s_m": "the largest from then on, m",
    "control_rmse_m": "estimate to reference, RMS from 20 s on, m; on the state the same as `rmse_after_20s_m`",
    "estimation_rmse_m": "on sensors: estimate to truth, `horizontal` and `vertical`, RMS from 20 s on, m",
    "attitude_rmse_deg": "on sensors: `roll`, `pitch`, `yaw` of the estimate, RMS from 20 s on, degrees",
    "nees_mean": "on sensors: normalised estimation error squared, of nine numbers: 9 is right",
    "nis_mean": "on sensors, by kind of measurement: `mean` in parts of what is right, and the number of `innovations`",
    "max_tilt_deg": "largest tilt, degrees",
    "effort_n_m": "RMS of the moment, N m",
    "solve_time_us": "of the QPs, `p50`, `p99` and `max`, µs",
    "control_step_us": "of the control steps, `p50`, `p99` and `max`, µs",
    "qp_iterations": "of the QPs' solver, `mean`, `p50`, `p99`, `max`",
    "frames": "that the plant sent",
    "resent": "sent again",
    "qp_failures": "QPs without a solution",
    "qp_status": "how the QPs ended, counted",
    "fallbacks": "samples flown by each of them",
    "constrained_samples": "samples at which constraints of each kind were active",
    "max_slack": "largest planned excess of a soft limit, in parts of it",
    "path_lag_s": "by which path time was behind the clock at the end, s; null for a law that keeps to the clock",
    "trajectory_sha256": "hash of the plant's states at every frame",
}


def tables() -> list[str]:
    """Return the tables of the page, in their order."""
    sensors = load_vehicle("hummingbird").sensors
    assert sensors is not None
    logs = {
        "flight.csv": COLUMNS,
        "plant.csv": TRUTH_COLUMNS,
        "autopilot.csv": DECISION_COLUMNS,
        "estimate.csv": ESTIMATE_COLUMNS,
        "filter.csv": check_columns(kinds_of(sensors)),
    }
    return [
        *(
            "\n".join([f"| of `{name}` | unit | what it is |", "|---|---|---|", *_rows(of)])
            for name, of in logs.items()
        ),
        "\n".join(["| of `report.json` | what it is |", "|---|---|", *_keys()]),
    ]


def _rows(columns: Iterable[str]) -> Iterator[str]:
    """Yield a row for each run of columns that mean the same."""
    runs: list[tuple[list[str], str, str]] = []
    for column in columns:
        unit, meaning = _meaning(column)
        if runs and runs[-1][2] == meaning:
            runs[-1][0].append(column)
        else:
            runs.append(([column], unit, meaning))
    for names, unit, meaning in runs:
        shown = names if len(names) <= _MANY else [names[0], "…", names[-1]]
        yield f"| {', '.join(name if name == '…' else f'`{name}`' for name in shown)} | {unit} | {meaning} |"


def _meaning(column: str) -> tuple[str, str]:
    if column == "qp_status":
        return "", "how the QP ended: " + _codes(STATUS_CODES)
    if column == "fallback":
        return "", "what decided in its place: " + _codes(FALLBACK_CODES)
    ((unit, meaning),) = [(unit, what) for pattern, unit, what in _MEANINGS if re.fullmatch(pattern, column)]
    return unit, meaning


def _codes(codes: Mapping[Any, int]) -> str:
    return ", ".join(f"{code} {name or 'nothing'}" for name, code in codes.items())


def report_keys() -> list[str]:
    """Return the keys of a report, in their order, from the function that makes it."""
    returned = next(node for node in ast.walk(ast.parse(getsource(report))) if isinstance(node, ast.Return))
    assert isinstance(returned.value, ast.Dict)
    keys: list[str] = []
    for key in returned.value.keys:
        keys += FIGURES if key is None else [ast.literal_eval(key)]
    return keys


def _keys() -> Iterator[str]:
    names = report_keys()
    assert set(names) == _REPORT.keys(), set(names) ^ _REPORT.keys()
    for name in names:
        yield f"| `{name}` | {_REPORT[name]} |"


def write(folder: Path) -> None:
    """Write the tables."""
    renew_tables(folder / "files.md", tables())
