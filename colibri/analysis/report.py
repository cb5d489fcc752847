"""Quality of a flight: `report.json`, and the table for people."""

import json
from math import degrees, inf, isfinite
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from colibri.analysis.estimation import FIGURES, read_estimation, rms
from colibri.analysis.lost import (
    LIMIT_CYCLE_RAD_S,
    FlightSeries,
    Lost,
    ground_contact_s,
    ground_hits,
    impact,
    limit_cycle_rad_s,
)
from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.autopilot.control.interface import FALLBACK_CODES, STATUS_CODES, Fallback
from colibri.autopilot.control.qp import QpStatus
from colibri.common.elementary import acos
from colibri.common.types import Array
from colibri.flights.plan import FlightPlan, FrameCount
from colibri.mavlink.hil.feedback import Feedback
from colibri.mavlink.ulog.log import TopicReader

Report: TypeAlias = dict[str, Any]

_SMALL_M, _TINY_M = 0.01, 0.5e-6
_INSTANT_S = 1e-6  # times are whole microseconds


def report(
    plan: FlightPlan, log: TopicReader, summary: FrameCount | None, flight: FlightSeries, lost: Lost | None
) -> Report:
    """Return the figures of a flight; errors are at the same instant or path time, effort is the RMS of U2..U4."""
    wall_time_s, frames, resent = summary or (None, None, None)
    error, t = flight.position_error_m, flight.t
    sim_time_s = float(t[-1])
    begin_s, end_s = plan.spec.window or (inf, inf)
    within = error[(t >= begin_s - _INSTANT_S) & (t <= end_s + _INSTANT_S)]
    settled = error[t >= SETTLED_AFTER_S]
    estimation: Report = dict.fromkeys(FIGURES) | {FIGURES[0]: rms(settled) if len(settled) else None}
    if plan.spec.feedback is Feedback.SENSORS:
        estimation = read_estimation(plan, log, SETTLED_AFTER_S).figures()
    return {
        "track": str(plan.spec.track),
        "track_note": plan.track_note,
        "track_duration_s": plan.track.duration_s if isfinite(plan.track.duration_s) else None,
        "without_effect": plan.without_effect,
        "profile": plan.profile.name,
        "controller": plan.profile.controller,
        "link": plan.spec.link,
        "seed": plan.spec.seed,
        "feedback": plan.spec.feedback,
        "solver": plan.profile.table(plan.profile.controller).get("qp", {}).get("solver"),
        "vehicle": plan.vehicle_name,
        "plant_vehicle": plan.plant_vehicle_name,
        "integrator": plan.integrator,
        "wind": str(plan.spec.weather.wind),
        "gusts": [str(gust) for gust in plan.spec.weather.gusts],
        "turbulence": plan.spec.weather.turbulence,
        "without": list(plan.spec.without),
        "start": plan.start._asdict(),
        "sim_time_s": sim_time_s,
        "lost": None if lost is None else lost.why,
        "lost_at_s": None if lost is None else lost.at_s,
        "ground_contact_s": ground_contact_s(plan.plant_vehicle, flight),
        "ground_hits": ground_hits(plan.plant_vehicle, flight),
        "impact": impact(flight),
        "limit_cycle_rad_s": limit_cycle_rad_s(flight),
        "wall_time_s": wall_time_s,
        "real_time_factor": sim_time_s / wall_time_s if wall_time_s else None,
        "mean_error_m": float(error.mean()),
        "rmse_m": rms(error),
        "max_error_m": float(error.max()),
        "rmse_after_20s_m": rms(settled) if len(settled) else None,
        "max_error_after_20s_m": float(settled.max()) if len(settled) else None,
        "window_s": None if plan.spec.window is None else list(plan.spec.window),
        "mean_error_in_window_m": float(within.mean()) if len(within) else None,
        "rmse_in_window_m": rms(within) if len(within) else None,
        "max_error_in_window_m": float(within.max()) if len(within) else None,
        **estimation,
        "max_tilt_deg": degrees(acos(max(-1.0, min(1.0, float(flight.upright.min()))))),
        "effort_n_m": rms(flight.moment_n_m),
        "solve_time_us": _quantiles(flight.solve_time_us),
        "control_step_us": _quantiles(flight.control_step_us),
        "control_interval_us": round(1e6 * float(t[1] - t[0])),
        "qp_iterations": _iterations(flight.qp_iterations),
        "frames": frames,
        "resent": resent,
        "qp_failures": int(np.count_nonzero(flight.qp_status > STATUS_CODES[QpStatus.SOLVED])),
        "qp_status": _counts(flight.qp_status, {str(status): STATUS_CODES[status] for status in QpStatus}),
        "fallbacks": _counts(flight.fallback, {str(fallback): FALLBACK_CODES[fallback] for fallback in Fallback}),
        "constrained_samples": flight.constrained._asdict(),
        "max_slack": flight.max_slack,
        "path_lag_s": flight.path_lag_s,
        "trajectory_sha256": flight.trajectory_sha256,
    }


def encoded_report(figures: Report) -> bytes:
    return f"{json.dumps(figures, indent=2)}\n".encode()


def write_report(figures: Report, path: Path) -> None:
    path.write_bytes(encoded_report(figures))


def print_report(figures: Report, out: Path, *, flown_by: str | None = None) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    title = escape(f"{figures['track']}, {flown_by or 'profile ' + figures['profile']}")
    table = Table(title=title, show_header=False, title_justify="left")
    for name, value in (report_rows(figures) | {"written to": str(out)}).items():
        table.add_row(name, value)
    Console().print(table)


def report_rows(figures: Report) -> dict[str, str]:
    def times(name: str) -> str:
        return f"{figures[name]['p50']:.0f} / {figures[name]['p99']:.0f} µs"

    settled = figures["rmse_after_20s_m"]
    fallbacks = [f"{count} {name}" for name, count in figures["fallbacks"].items() if count]
    lost = {} if figures["lost"] is None else {f"lost at t = {figures['lost_at_s']:.2f} s": figures["lost"]}
    lost |= {} if figures["impact"] is None else {"impact": figures["impact"]}
    hits, swing_rad_s = figures.get("ground_hits"), figures.get("limit_cycle_rad_s") or 0.0
    lost |= {"ground hits": f"{hits}, {figures['ground_contact_s']:.2f} s on the ground"} if hits else {}
    lost |= {"limit cycle": f"{swing_rad_s:.1f} rad/s, RMS"} if swing_rad_s > LIMIT_CYCLE_RAD_S else {}
    has_qp = figures["solver"] is not None or figures["solve_time_us"]["max"] > 0.0
    step_us, interval_us = figures["control_step_us"]["p50"], figures["control_interval_us"]
    slow = f"{step_us / 1e3:.1f} ms a control step, every {interval_us / 1e3:g} ms" if step_us > interval_us else ""
    within = figures.get("rmse_in_window_m")  # reports of earlier versions lack it
    lost |= {"position error, mean": length(figures["mean_error_m"])} if "mean_error_m" in figures else {}
    return lost | {
        "position error, RMS": length(figures["rmse_m"]),
        f"position error, RMS after {SETTLED_AFTER_S:.0f} s": "-" if settled is None else length(settled),
        **({} if within is None else _window_rows(figures)),
        **_estimation_rows(figures),
        "position error, maximum": length(figures["max_error_m"]),
        **({} if figures["path_lag_s"] is None else {"behind the clock at the end": f"{figures['path_lag_s']:.2f} s"}),
        **({"QP solve time, p50 / p99": times("solve_time_us")} if has_qp else {}),
        "control step, p50 / p99": times("control_step_us"),
        **({"slower than real time": slow} if slow else {}),
        "flown": f"{figures['sim_time_s']:.1f} s in {figures['wall_time_s']:.2f} s",
        "real-time factor": f"{figures['real_time_factor']:.0f}",
        "frames, sent again": f"{figures['frames']}, {figures['resent']}",
        **({"QPs not solved": f"{figures['qp_failures']}"} if has_qp else {}),
        "samples flown by a fallback": ", ".join(fallbacks) or "0",
        "trajectory": figures["trajectory_sha256"][:16],
    }


def _window_rows(figures: Report) -> dict[str, str]:
    begin_s, end_s = figures["window_s"]
    names = ("mean_error_in_window_m", "rmse_in_window_m", "max_error_in_window_m")
    values = ", ".join(length(figures[name]) for name in names)
    return {f"mean, RMS, maximum from {begin_s:g} to {end_s:g} s": values}


def _estimation_rows(figures: Report) -> dict[str, str]:
    if figures["estimation_rmse_m"] is None:
        return {}
    off, turned = figures["estimation_rmse_m"], figures["attitude_rmse_deg"]
    return {
        "estimate from reference, RMS": length(figures["control_rmse_m"]),
        "estimate from truth, RMS": f"{length(off['horizontal'])} horizontal, {length(off['vertical'])} vertical",
        "attitude, RMS": f"roll {turned['roll']:.2f}°, pitch {turned['pitch']:.2f}°, yaw {turned['yaw']:.2f}°",
        "NEES, mean of 9 numbers": f"{figures['nees_mean']:.2f}",
        "NIS, relative to its expected value": ", ".join(
            f"{kind} {nis['mean']:.2f}" for kind, nis in figures["nis_mean"].items() if nis["innovations"]
        ),
    }


def length(metres: float) -> str:
    """Format a length, small ones in mm, and what would be 0.000 mm in nm."""
    if 0.0 < metres < _TINY_M:
        return f"{1e9 * metres:.3g} nm"
    return f"{metres:.4f} m" if metres >= _SMALL_M else f"{1e3 * metres:.3f} mm"


def _counts(codes: NDArray[np.int8], names: dict[str, int]) -> dict[str, int]:
    return {name: int(np.count_nonzero(codes == code)) for name, code in names.items()}


def _iterations(taken: NDArray[np.float32]) -> dict[str, float] | None:
    known = taken[~np.isnan(taken)].astype(np.float64)
    return {"mean": float(known.mean()), **_quantiles(known)} if len(known) else None


def _quantiles(values: Array) -> dict[str, float]:
    p50, p99 = np.quantile(values, [0.5, 0.99])
    return {"p50": float(p50), "p99": float(p99), "max": float(values.max())}
