"""Flights of any length: what their analysis holds in memory is bounded, and its results do not know of blocks."""

import json
import tracemalloc
from dataclasses import fields
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colibri.analysis import logs
from colibri.analysis.estimation import read_estimation, rms
from colibri.analysis.logs import Rows, at_times, read_blocks, read_series
from colibri.analysis.outcome import keep_flight
from colibri.analysis.recording import COLUMNS, FlightReader, Recording, read_recording
from colibri.analysis.series import figure_series
from colibri.analysis.series.figure_series import FigureSeries
from colibri.analysis.series.flight_series import read_flight
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan, Summary
from colibri.flights.spec import FlightSpec

ONE_ROW, SOME_ROWS, ALL_ROWS = 50, 10_000, 1 << 30
SUMMARY = Summary(1.0, 1, 0)
MAX_BYTES_A_SAMPLE = 100
"""A row of the table alone has 216, and its text 500."""


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> FlightPlan:
    out = tmp_path_factory.mktemp("flown")
    plan = FlightPlan.of(FlightSpec.of("lemniscate", profile="path", feedback="sensors", duration=5.0, out=out))
    fly_locally(plan)
    return plan


def in_blocks(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(logs, "BLOCK_BYTES", size)


def kept(plan: FlightPlan) -> tuple[Any, str]:
    report = keep_flight(plan, SUMMARY)
    assert json.loads((plan.out / "report.json").read_text(encoding="utf-8")) == report
    return report, sha256((plan.out / "flight.csv").read_bytes()).hexdigest()


def test_blocks_hold_the_complete_rows_in_their_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also numbers that are none; not a row that was cut off, nor one with another number of columns."""
    path, rows = tmp_path / "log.csv", [[0.1, -1e-300, 3.0], [np.nan, np.inf, -np.inf], [1e22, 5e-324, -0.0]]
    text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    path.write_text(f"a,b,c\n{text}1,2\n{text}1,2,3", encoding="utf-8")
    for size in (1, 7, ALL_ROWS):
        in_blocks(monkeypatch, size)
        assert np.concatenate(list(read_blocks(path))).tobytes() == np.array(rows + rows).tobytes()
        third, first = read_series(path, 2, 0)
        assert np.stack([third, first]).tobytes() == np.array(rows + rows)[:, [2, 0]].T.tobytes()
        wanted = np.array([False, False, True, True, False])
        chosen = Rows(path, wanted)
        assert chosen.take(1).tolist() + chosen.take(5).tolist() == [rows[2], rows[0]]
    path.write_text("a,b,c\n", encoding="utf-8")
    assert list(read_blocks(path)) == []
    assert [series.shape for series in read_series(path, 0, 1)] == [(0,), (0,)]


def test_instants_are_the_same_to_the_microsecond() -> None:
    instants_s = np.array([0.0, 0.004, 0.008000000000000002])
    assert at_times(np.array([0.008, 0.004001, 0.004, 1.0, 0.0]), instants_s).tolist() == [
        True,
        False,
        True,
        False,
        True,
    ]
    assert not at_times(instants_s, np.empty(0)).any()


@pytest.mark.long
def test_parts_joined_are_the_flight_to_the_bit(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks(monkeypatch, ALL_ROWS)
    whole, (as_one,) = read_recording(plan), FlightReader(plan)
    assert np.array_equal(as_one.table, whole.table)
    assert len(whole.table) == len(whole.slack) + 1 == FlightReader(plan).samples
    for size in (ONE_ROW, SOME_ROWS):
        in_blocks(monkeypatch, size)
        assert len(list(FlightReader(plan))) > (30 if size == SOME_ROWS else 480)
        again = read_recording(plan)
        for name in (each.name for each in fields(Recording)):
            assert np.array_equal(getattr(again, name), getattr(whole, name)), name


@pytest.mark.long
def test_report_and_table_do_not_depend_on_blocks(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks(monkeypatch, ALL_ROWS)
    whole = kept(plan)
    for size in (ONE_ROW, SOME_ROWS):
        in_blocks(monkeypatch, size)
        assert kept(plan) == whole


def test_the_report_is_that_of_the_whole_table(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same numbers, not almost."""
    recording = read_recording(plan)
    in_blocks(monkeypatch, SOME_ROWS)
    report, _ = kept(plan)
    moments = np.linalg.norm(recording.columns(("U2", "U3", "U4")), axis=1)
    assert report["rmse_m"] == rms(recording.position_error_m)
    assert report["max_error_m"] == recording.position_error_m.max()
    assert report["effort_n_m"] == rms(moments)
    assert report["max_slack"] == recording.slack.max()
    assert report["path_lag_s"] == recording.path_lag_s
    assert report["trajectory_sha256"] == recording.trajectory_sha256
    for name in ("solve_time_us", "control_step_us"):
        times_us = getattr(recording, name)
        assert report[name] == {
            "p50": np.quantile(times_us, 0.5),
            "p99": np.quantile(times_us, 0.99),
            "max": times_us.max(),
        }
    assert report["qp_iterations"] == {
        "mean": recording.qp_iterations.mean(),
        "p50": np.quantile(recording.qp_iterations, 0.5),
        "p99": np.quantile(recording.qp_iterations, 0.99),
        "max": recording.qp_iterations.max(),
    }
    counts = np.count_nonzero(recording.active, axis=0).tolist()
    assert list(report["constrained_samples"].values()) == counts
    assert sum(report["qp_status"].values()) == len(recording.slack)
    text = (plan.out / "flight.csv").read_text(encoding="utf-8")
    rows = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in recording.table.tolist())]
    assert text == "\n".join(rows) + "\n"


def test_estimation_does_not_depend_on_blocks(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read_estimation(plan, 2.0)
    in_blocks(monkeypatch, SOME_ROWS)
    again = read_estimation(plan, 2.0)
    for name in whole._fields:
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    assert read_estimation(plan, 0.0).figures()["nees_mean"] != whole.figures()["nees_mean"]


def test_figures_do_not_depend_on_blocks(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    for size in (ALL_ROWS, SOME_ROWS, ONE_ROW):
        in_blocks(monkeypatch, size)
        flown = FigureSeries(plan)
        for part in FlightReader(plan):
            flown.add(part)
        drawn.append((flown.over_time(), flown.in_space()))
    for series, path in drawn[1:]:
        assert series.keys() == drawn[0][0].keys()
        for name, values in drawn[0][0].items():
            assert series[name] == pytest.approx(values, rel=1e-12, abs=1e-12, nan_ok=True), name
        assert all(np.array_equal(path[name], values) for name, values in drawn[0][1].items())


def lengthened(plan: FlightPlan, out: Path, rounds: int) -> FlightPlan:
    """Return the plan of a flight that repeats another again and again, its logs written in `out`."""
    lasts_s = plan.spec.duration
    longer = FlightPlan.of(FlightSpec.of("lemniscate", profile="path", duration=rounds * lasts_s, out=out))
    out.mkdir()
    for name in ("plant.csv", "autopilot.csv"):
        header, *lines = (plan.out / name).read_text(encoding="utf-8").splitlines()
        rows = [(float(time), rest) for time, _, rest in (line.partition(",") for line in lines)]
        with (out / name).open("w", encoding="utf-8") as log:
            print(header, file=log)
            for began_s in np.arange(rounds) * lasts_s:
                for time_s, rest in rows:
                    if time_s < lasts_s:  # the last is the first of the next
                        print(f"{round(began_s + time_s, 6)},{rest}", file=log)
    return longer


def peak_bytes(plan: FlightPlan) -> int:
    """Return how much memory it takes to keep a flight and all that is drawn of it, at most."""
    tracemalloc.start()
    try:
        flown = FigureSeries(plan)
        keep_flight(plan, SUMMARY, flown.add)
        flown.over_time()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.long
def test_memory_hardly_grows_with_the_flight(plan: FlightPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks(monkeypatch, 1 << 14)
    monkeypatch.setattr(figure_series, "MAX_POINTS", 1 << 10)
    monkeypatch.setattr(figure_series, "MAX_PATH_POINTS", 1 << 10)
    flights = [lengthened(plan, tmp_path / str(rounds), rounds) for rounds in (4, 20)]
    samples = [FlightReader(flight).samples for flight in flights]
    few, many = (peak_bytes(flight) for flight in flights)
    assert samples[1] - samples[0] > 7000
    assert (many - few) / (samples[1] - samples[0]) < MAX_BYTES_A_SAMPLE


def test_what_is_kept_of_a_sample(plan: FlightPlan) -> None:
    flight = read_flight(FlightReader(plan))
    arrays = [value for value in vars(flight).values() if isinstance(value, np.ndarray)]
    assert sum(array.nbytes for array in arrays) < 57 * len(flight.t)
