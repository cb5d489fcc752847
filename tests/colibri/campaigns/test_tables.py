import csv
import sys
from importlib import import_module
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D

from colibri.campaigns.factors import CampaignError
from colibri.campaigns.figure import label_of
from colibri.campaigns.flight_table import wilson
from colibri.campaigns.flights import FlightResult, Verdict
from colibri.campaigns.results import CampaignResults
from colibri.campaigns.run import fly_campaign
from tests.support.campaigns import MASS, Here, planned, results, tables_in

LATENCY, FLOOR = "latency", "floor"


def made(verdicts: dict[int, Verdict] | None = None, **tables: Any) -> CampaignResults:
    """Return results that nobody has flown: the error is ten times the latency, plus a thousandth of the seed."""
    campaign = planned(metrics=["rmse_m", "max_tilt_deg"], **tables)
    rows = {}
    for point in campaign.points():
        verdict = (verdicts or {}).get(point.flight, Verdict.FLOWN)
        error = 10.0 * float(point.factors.get(LATENCY, 1.0)) + 1e-3 * point.seed
        rows[point.flight] = FlightResult(point.flight, verdict, "", (error, None), f"hash{point.flight}")
    return CampaignResults(campaign, rows)


@pytest.mark.parametrize(
    ("lost", "of", "bounds"),
    [(0, 10, (0.0, 0.277533)), (5, 10, (0.236593, 0.763407)), (10, 10, (0.722467, 1.0)), (1, 50, (0.003539, 0.104954))],
)
def test_wilson_s_interval(lost: int, of: int, bounds: tuple[float, float]) -> None:
    assert wilson(lost, of) == pytest.approx(bounds, abs=1e-6)


def test_of_nothing_nothing_is_known() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


def test_a_row_a_flight(tmp_path: Path) -> None:
    flown = results(seeds="1-2", grid={"track": ["hover"], MASS: [0.7, 0.72]}, metrics=["rmse_m", "lost_at_s"])
    flown.save(tmp_path)
    with (tmp_path / "flights.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    factors = [(row["flight"], row[MASS], row["seed"]) for row in rows]
    assert factors == [("0", "0.7", "1"), ("1", "0.7", "2"), ("2", "0.72", "1"), ("3", "0.72", "2")]
    assert all(row["verdict"] == "flown" and len(row["trajectory_sha256"]) == 64 for row in rows)
    assert all(float(row["rmse_m"]) > 0.0 and row["lost_at_s"] == "" for row in rows)
    assert flown.flights[MASS].tolist() == [0.7, 0.7, 0.72, 0.72]
    assert flown.flights["verdict"].tolist() == ["flown"] * 4
    assert np.isnan(flown.flights["lost_at_s"]).all()
    assert (tmp_path / "campaign.png").stat().st_size > 10_000


def test_parquet_has_the_same_table(tmp_path: Path) -> None:
    flown = made({1: Verdict.LOST}, seeds="1-3", grid={"track": ["hover"], LATENCY: [1.0, 2.0]})
    flown.save(tmp_path, parquet=True)
    read = import_module("pyarrow.parquet").read_table(tmp_path / "flights.parquet")
    assert tuple(read.column_names) == flown.headings
    assert read["rmse_m"].to_pylist() == flown.flights["rmse_m"].tolist()
    assert read["verdict"].to_pylist()[:2] == ["flown", "lost"]
    assert all(map(np.isnan, read["max_tilt_deg"].to_pylist()))


def test_without_pyarrow_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(CampaignError, match=r"pip install colibri-sitl\[parquet\]"):
        fly_campaign(planned(), Here(), tmp_path / "out", parquet=True)
    assert not (tmp_path / "out").exists()


def test_the_summary_has_quantiles_of_what_came_through(tmp_path: Path) -> None:
    verdicts = {1: Verdict.LOST, 2: Verdict.KILLED, 5: Verdict.REFUSED}
    flown = made(verdicts, seeds="1-5", grid={"track": ["hover"], LATENCY: [1.0, 2.0]})
    flown.save(tmp_path)
    first, second = csv.DictReader(tables_in(tmp_path)[1].splitlines())
    assert [first[name] for name in ("track", LATENCY, "flights", "refused", "lost", "share_lost")] == [
        *("hover", "1.0", "5", "0", "2", "0.4")
    ]
    assert [first[f"rmse_m_{which}"] for which in ("median", "largest")] == ["10.004", "10.005"]
    assert first["max_tilt_deg_median"] == ""
    assert [second[name] for name in ("flights", "refused", "lost", "share_lost")] == ["5", "1", "0", "0"]
    assert [float(second[f"share_lost_{end}"]) for end in ("low", "high")] == pytest.approx(wilson(0, 4))


def test_a_metric_that_was_not_kept_is_refused() -> None:
    with pytest.raises(CampaignError, match="metric effort_n_m is not in the table: choose rmse_m, max_tilt_deg"):
        made().plot("effort_n_m")


def points(line: Line2D) -> list[list[float]]:
    return [np.asarray(values).tolist() for values in line.get_data()]


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("rmse_after_20s_m", "RMSE after 20 s (m)"),
        ("max_tilt_deg", "maximum tilt (°)"),
        ("solve_time_us.p99", "solve time, 99th percentile (µs)"),
        ("attitude_rmse_deg.roll", "attitude RMSE, roll (°)"),
        ("qp_failures", "QP failures"),
        ("limit_cycle_rad_s", "limit cycle (rad/s)"),
        ("effort_n_m", "effort (N m)"),
        ("vehicle.mass_kg", "vehicle, mass (kg)"),
        (LATENCY, "latency (ms)"),
    ],
)
def test_figures_label_axes_in_words_with_units(name: str, label: str) -> None:
    assert label_of(name) == label


def test_over_a_factor_it_is_a_line_a_combination() -> None:
    grid = {"track": ["hover", "spiral"], LATENCY: "1:5:5"}
    upper, lower = made({0: Verdict.LOST}, seeds="1-2", grid=grid).plot().axes
    assert upper.get_legend_handles_labels()[1] == ["hover", "spiral"]
    assert lower.get_xlabel() == label_of(LATENCY)
    latency, error = points(upper.get_lines()[0])
    assert latency == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert error == pytest.approx([10.002, 20.0015, 30.0015, 40.0015, 50.0015])
    assert points(lower.get_lines()[0])[1] == [0.5, 0.0, 0.0, 0.0, 0.0]


def test_over_two_factors_it_is_a_heat_map() -> None:
    grid = {"track": ["hover"], LATENCY: "1:4:4", FLOOR: "0:1:3"}
    figure = made({0: Verdict.LOST}, grid=grid).plot()
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (label_of(LATENCY), label_of(FLOOR))
    (mesh,) = (each for each in axes.collections if each.get_array() is not None)
    medians: Any = np.ma.filled(np.ma.asarray(mesh.get_array()).reshape(3, 4), nan)
    assert np.isnan(medians[0, 0])
    assert medians[1].tolist() == [10.0, 20.0, 30.0, 40.0]
    assert [points(line) for line in axes.get_lines()] == [[[0.5], [0.5]]]


def test_over_what_is_drawn_it_is_a_dot_a_flight() -> None:
    figure = made({3: Verdict.LOST}, seeds="0-9", draw={LATENCY: {"uniform": [1.0, 2.0]}}).plot()
    (axes,) = figure.axes
    assert axes.get_xlabel() == label_of(LATENCY)
    through, lost = axes.get_lines()
    assert (len(points(through)[0]), len(points(lost)[0])) == (9, 1)


def test_without_numbers_it_is_a_strip_a_combination() -> None:
    grid = {"track": ["hover", "spiral"], "turbulence": ["light", "severe"]}
    (axes,) = made({1: Verdict.LOST}, seeds="1-3", grid=grid).plot().axes
    assert [label.get_text() for label in axes.get_yticklabels()] == [
        *("hover, light", "hover, severe", "spiral, light", "spiral, severe")
    ]
    assert "1 lost" in {text.get_text() for text in axes.texts}


def test_a_notebook_shows_summary_and_figure() -> None:
    shown = made(seeds="1-2")._repr_html_()
    assert "share_lost" in shown
    assert "data:image/png;base64," in shown
