"""`--fail-above` and `--fail-lost`, for continuous integration."""

from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from colibri.common.errors import unknown
from colibri.common.process.arguments import number

RMSE = "rmse_after_20s_m"
KEYS = (
    *(RMSE, "max_error_after_20s_m", "mean_error_m", "rmse_m", "max_error_m", "control_rmse_m"),
    *("mean_error_in_window_m", "rmse_in_window_m", "max_error_in_window_m"),
    *("estimation_rmse_m.horizontal", "estimation_rmse_m.vertical"),
    *("attitude_rmse_deg.roll", "attitude_rmse_deg.pitch", "attitude_rmse_deg.yaw", "nees_mean"),
    *("max_tilt_deg", "ground_contact_s", "ground_hits", "limit_cycle_rad_s", "effort_n_m", "max_slack"),
    *("qp_failures", "fallbacks", "resent"),
    *("qp_iterations.mean", "qp_iterations.p99", "qp_iterations.max"),
    *("solve_time_us.p50", "solve_time_us.p99", "control_step_us.p50", "control_step_us.p99"),
)
"""Numbers of `report.json` that may have a limit; `fallbacks` is a sum."""


class ReportLimit(NamedTuple):
    """Largest permitted value of a number in the report."""

    key: str
    value: float


class LossLimit(NamedTuple):
    """Most flights that may be lost or refused, or their percentage."""

    most: float
    percent: bool = False


NONE_LOST = LossLimit(0.0)


def loss_limit(text: str) -> LossLimit:
    percent = text.endswith("%")
    try:
        most = number(text.removesuffix("%")) if percent else float(int(text))
    except ValueError:
        most = -1.0
    if most < 0.0 or (percent and most > 100.0):
        raise ArgumentTypeError(f'must be a number of flights or a percentage, for example 3 or 5%, not "{text}"')
    return LossLimit(most, percent)


def loss_exceeds(limit: LossLimit | None, lost: int, flights: int) -> str:
    """Describe the loss of too many flights; without a limit, of all."""
    if limit is None:
        return f"all {flights} flights were lost or refused" if lost == flights else ""
    most = limit.most * flights / 100.0 if limit.percent else limit.most
    unit = "%" if limit.percent else ""
    return (
        f"--fail-lost: {lost} of {flights} flights were lost or refused, above {limit.most:g}{unit}"
        if lost > most
        else ""
    )


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
    return [reason for limit in limits if (reason := above(limit, of_report(report, limit.key)))]


def above(limit: ReportLimit, flown: float | None) -> str:
    """Describe a number above its limit, or unknown."""
    if flown is None:
        return f"{limit.key} is missing in this flight; its limit is {limit.value:g}"
    return "" if flown <= limit.value else f"{limit.key} is {flown:.4g}, above {limit.value:g}"


def of_report(report: Mapping[str, Any], key: str) -> Any:
    """Return a number, or the sum of a table."""
    found: Any = report
    for part in key.split("."):
        found = None if found is None else found.get(part)
    return sum(found.values()) if isinstance(found, dict) else found
