"""`colibri compare --seeds`: the distribution of errors over many seeds."""

import argparse
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from colibri.analysis.estimation import MEASURED, rms
from colibri.analysis.recording import SETTLED_AFTER_S
from colibri.analysis.tables import Row, comma_separated, print_table, write_table
from colibri.campaigns.flight_table import FlightTable
from colibri.campaigns.flights import Verdict
from colibri.campaigns.gate import handed_over, with_limits
from colibri.campaigns.metrics import Metric
from colibri.common.types import Array
from colibri.mavlink.hil.feedback import Feedback
from colibri.studies.comparison import fly_comparison

HEADINGS = (
    *("profile", "track", "flights", "lost"),
    *("control (m)", "true (m)", "est. horizontal (m)", "est. vertical (m)", "roll (°)", "pitch (°)", "yaw (°)"),
    "NEES",
)
_WITHOUT_ESTIMATE = 5
"""Columns of a flight on the state."""
_ERRORS = (
    *("control_rmse_m", "rmse_after_20s_m", "estimation_rmse_m.horizontal", "estimation_rmse_m.vertical"),
    *("attitude_rmse_deg.roll", "attitude_rmse_deg.pitch", "attitude_rmse_deg.yaw"),
)
NEES = "nees_mean"


METRICS = (
    *map(Metric, (*_ERRORS, NEES)),
    *(Metric(f"nis_mean.{kind}.{figure}") for kind in MEASURED for figure in ("mean", "innovations")),
)
"""RMS of one flight after 20 s, m and degrees; mean NEES; by kind mean NIS, relative, and innovations."""


def compare_seeds(args: argparse.Namespace) -> int:
    table = fly_comparison(args, "seeds", with_limits(METRICS, args.fail_above), "none")
    (args.out / "seeds-flights.csv").write_text(comma_separated(table.headings, table.rows()), encoding="utf-8")
    rows = [(*names, *_cells(table, places)) for names, places in table.groups().items()]
    write_table(args.out / "seeds", HEADINGS, rows, names=2, notes=table.notes)
    from colibri.studies.seed_figures import draw_seeds

    draw_seeds(table, args.out)
    lost = [each for each in table.flown if each.verdict is not Verdict.FLOWN]
    if not (args.quiet or args.json):
        over = f"after {SETTLED_AFTER_S:.0f} s, root mean squares over all flights (largest of one)"
        shown = len(HEADINGS) if args.feedback is Feedback.SENSORS else _WITHOUT_ESTIMATE
        print_table(f"{over}; written to {args.out}", HEADINGS[:shown], [row[:shown] for row in rows], names=2)
        print(*table.notes, sep="\n", end="\n" if table.notes else "")  # noqa: T201
        for flown, row in zip(table.flown, table.rows(), strict=True):
            if flown in lost:
                print(f"{row[1]}, {row[2]}, seed {row[3]}: lost: {flown.why}")  # noqa: T201
    return handed_over(table, args)


def _cells(table: FlightTable, places: Sequence[int]) -> Row:
    """Return RMS over flights, mean NEES, and in brackets the largest."""
    through = table.through(places)
    errors = (_cell(table.metric(name)[through], rms) for name in _ERRORS)
    flown, lost = str(len(places)), str(len(places) - len(through))
    return (flown, lost, *errors, _cell(table.metric(NEES)[through], np.mean))


def _cell(column: Array, middle: Callable[[Array], Any]) -> str:
    if not len(column) or np.isnan(column).any():
        return "-"
    return f"{middle(column):.3g} ({column.max():.3g})"
