"""`colibri compare`: controllers × tracks in one table, on the terminal, as Markdown and as CSV."""

import argparse

from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.tables import Row, print_table, write_table
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.metrics import Metric
from colibri.studies.comparison import fly_comparison

COLUMNS = (
    *("controller", "track", "RMS (m)", "maximum (m)", "effort (N m)", "QP p50 (µs)", "QP p99 (µs)"),
    *("lost at (s)", "why"),
)
_UNKNOWN = "-"


def _solve_time(quantile: str) -> Metric:
    return Metric(
        f"solve_time_us.{quantile}", lambda flight: flight.report["solver"] and flight.report["solve_time_us"][quantile]
    )


_METRICS = (
    *map(Metric, ("rmse_after_20s_m", "max_error_m", "effort_n_m")),
    *map(_solve_time, ("p50", "p99")),
    Metric("lost_at_s"),
)
_FORMATS = (".4g", ".4g", ".4g", ".0f", ".0f")


def compare(args: argparse.Namespace) -> int:
    """Compare; RMS is that after the first 20 s, the maximum includes the start."""
    table = fly_comparison(args, "compare", with_limits(_METRICS, args.fail_above), "all")
    rows = [(*names, *_cells(table.flown[place])) for names, (place,) in table.groups().items()]
    write_table(args.out / "compare", COLUMNS, rows, names=2, notes=table.notes)
    lost = any(row[-1] for row in rows)
    if not (args.quiet or args.json):
        title = f"RMS after {SETTLED_AFTER_S:.0f} s; written to {args.out}"
        shown = len(COLUMNS) - (1 if lost else 2)
        print_table(title, COLUMNS[:shown], [row[:shown] for row in rows], names=2)
        print(*table.notes, sep="\n", end="\n" if table.notes else "")  # noqa: T201
        for controller, track, *_, at_s, why in rows:
            if why:
                print(f"{controller}, {track}: lost at t = {at_s} s: {why}")  # noqa: T201
    return handed_over(table, args)


def _cells(flown: FlightResult) -> Row:
    *figures, lost_at_s = flown.metrics[: len(_METRICS)]
    cells = (_UNKNOWN if value is None else format(value, how) for value, how in zip(figures, _FORMATS, strict=True))
    if flown.verdict is Verdict.FLOWN:
        return (*cells, "", "")
    return (*cells, f"{lost_at_s:.2f}" if lost_at_s is not None else "0", flown.why)
