"""The tables of `files.md`: columns of `flight.csv` and of each topic, and keys of `report.json`."""

import ast
from collections.abc import Iterable, Iterator, Mapping
from inspect import getsource
from itertools import chain
from pathlib import Path
from typing import Any

from colibri.analysis.estimation import FIGURES
from colibri.analysis.recording import COLUMNS
from colibri.analysis.report import report
from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES
from colibri.mavlink.ulog.flight_topics import FLIGHT_TOPICS, Columns
from tools.pages.tables import renew_tables

_MANY = 6
_FLIGHT = (
    Columns("u v w", "m/s", "velocity in the body's axes, FLU"),
    Columns("p q r", "rad/s", "body rates, FLU"),
    Columns("x y z", "m", "position, ENU"),
    Columns("phi theta psi", "rad", "attitude, angles Z-Y'-X''; yaw unwrapped"),
    Columns("U1", "N", "thrust of all rotors"),
    Columns("U2 U3 U4", "N m", "moments about the body's axes, FLU"),
    Columns("phi_ref theta_ref psi_ref", "rad", "attitude setpoint"),
    Columns("omega1 omega2 omega3 omega4", "the vehicle's", "rotor speed, in the unit of the vehicle file"),
    Columns("x_ref y_ref z_ref", "m", "reference of the same instant, ENU"),
)
_CODES: dict[str, Mapping[Any, int]] = {"qp_status": STATUS_CODES, "fallback": FALLBACK_CODES}
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
    assert ("t", *chain.from_iterable(each.names.split() for each in _FLIGHT)) == COLUMNS
    logs = {"flight.csv": _FLIGHT, **{topic.name: topic.columns for topic in FLIGHT_TOPICS}}
    return [
        *(
            "\n".join([f"| of `{name}` | unit | what it is |", "|---|---|---|", *_rows(of)])
            for name, of in logs.items()
        ),
        "\n".join(["| of `report.json` | what it is |", "|---|---|", *_keys()]),
    ]


def _rows(columns: Iterable[Columns]) -> Iterator[str]:
    yield "| `t` | s | simulated time |"
    for each in columns:
        names = each.names.split()
        shown = names if len(names) <= _MANY else [names[0], "…", names[-1]]
        meaning = each.help + (f": {_codes(_CODES[each.names])}" if each.names in _CODES else "")
        yield f"| {', '.join(name if name == '…' else f'`{name}`' for name in shown)} | {each.unit} | {meaning} |"


def _codes(codes: Mapping[Any, int]) -> str:
    return ", ".join(f"{code} {name or 'nothing'}" for name, code in codes.items())


def report_keys() -> list[str]:
    """Return the keys of a report, from the source of the function that makes it."""
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
    renew_tables(folder / "files.md", tables())
