"""`--fail-above`: limits on numbers of a flight's report, for continuous integration."""

from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from colibri.common.errors import unknown
from colibri.common.process.arguments import number

RMSE = "rmse_after_20s_m"
KEYS = (
    *(RMSE, "max_error_after_20s_m", "rmse_m", "max_error_m", "control_rmse_m"),
    *("estimation_rmse_m.horizontal", "estimation_rmse_m.vertical"),
    *("attitude_rmse_deg.roll", "attitude_rmse_deg.pitch", "attitude_rmse_deg.yaw", "nees_mean"),
    *("max_tilt_deg", "ground_contact_s", "effort_n_m", "max_slack", "qp_failures", "fallbacks", "resent"),
    *("qp_iterations.mean", "qp_iterations.p99", "qp_iterations.max"),
    *("solve_time_us.p50", "solve_time_us.p99", "control_step_us.p50", "control_step_us.p99"),
)
"""Numbers of `report.json` that may have a limit, a table before the dot; `fallbacks` is their sum."""


class ReportLimit(NamedTuple):
    """Largest permitted value of a number in the report."""

    key: str
    value: float


def limit(text: str) -> ReportLimit:
    key, equals, value = text.rpartition("=")
    if equals and key not in KEYS:
        raise ArgumentTypeError(unknown("key", key, KEYS))
    try:
        return ReportLimit(key or RMSE, number(value))
    except ValueError:
        raise ArgumentTypeError(f"must be [KEY=]VALUE, for example 0.1 or qp_failures=0, not {text}") from None


def exceeded(limits: Iterable[ReportLimit], report: Mapping[str, Any]) -> list[str]:
    """Describe each limit that a report exceeds, or does not contain."""
    found = []
    for key, value in limits:
        flown = of_report(report, key)
        if flown is None:
            found.append(f"{key} is missing in this flight; its limit is {value:g}")
        elif not flown <= value:
            found.append(f"{key} is {flown:.4g}, above {value:g}")
    return found


def of_report(report: Mapping[str, Any], key: str) -> Any:
    """Return a number of a report, or the sum of a table."""
    found: Any = report
    for part in key.split("."):
        found = None if found is None else found[part]
    return sum(found.values()) if isinstance(found, dict) else found
