"""Flights of any length: what their analysis holds in memory is bounded, and its results do not know of blocks."""

import json
import tracemalloc
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colibri.analysis import figure_series
from colibri.analysis.estimation import read_estimation, rms
from colibri.analysis.figure_series import FigureSeries
from colibri.analysis.logs import Rows, at_times, csv_rows, log_of, read_blocks, read_series
from colibri.analysis.lost import read_flight
from colibri.analysis.outcome import keep_flight
from colibri.analysis.recording import COLUMNS, FlightReader, read_recording
from colibri.flights.in_process import fly_locally
from colibri.flights.plan import FlightPlan, FrameCount
from colibri.flights.spec import FlightSpec
from colibri.mavlink.ulog import reader
from colibri.mavlink.ulog.flight_topics import COMMAND, DECISION, TRUTH
from colibri.mavlink.ulog.log import MemoryLog, beginning

A_BLOCK, SOME_ROWS, ALL_ROWS = 1, 200, 1 << 30
SUMMARY = FrameCount(1.0, 1, 0)
MAX_BYTES_A_SAMPLE = 100  # a row of the table alone has 216, and its text 500


@pytest.fixture(scope="module", params=["flight", pytest.param("path", marks=pytest.mark.long)])
def plan(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> FlightPlan:
    out = tmp_path_factory.mktemp("flown")
    plan = FlightPlan.of(FlightSpec.of("lemniscate", profile=request.param, feedback="sensors", duration=5.0, out=out))
    fly_locally(plan)
    return plan


def in_blocks(monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    monkeypatch.setattr(reader, "ROWS_AT_ONCE", rows)


def kept(plan: FlightPlan) -> tuple[Any, str]:
    report = keep_flight(plan, SUMMARY)
    assert json.loads((plan.out / "report.json").read_text(encoding="utf-8")) == report
    return report, sha256((plan.out / "flight.csv").read_bytes()).hexdigest()


def test_rows_are_taken_in_their_order() -> None:
    log = MemoryLog()
    rows = np.arange(6.0 * 10).reshape(10, 6)
    for row in rows.tolist():
        log.add(COMMAND, (1e6 * row[0], *row[1:]))
    assert np.array_equal(np.concatenate(list(read_blocks(log, COMMAND))), rows)
    times, armed = read_series(log, COMMAND, "t", "armed")
    assert (times.tolist(), armed.tolist()) == (rows[:, 0].tolist(), rows[:, 5].tolist())
    wanted = np.array([False, False, True, True, False])
    chosen = Rows(log, COMMAND, wanted)
    assert np.array_equal(np.vstack([chosen.take(1), chosen.take(5)]), rows[2:4])
    assert list(read_blocks(log, TRUTH)) == []
    assert [series.shape for series in read_series(log, TRUTH, "t", "x")] == [(0,), (0,)]


def test_instants_are_the_same_to_the_microsecond() -> None:
    instants_s = np.array([0.0, 0.004, 0.008000000000000002])
    found = at_times(np.array([0.008, 0.004001, 0.004, 1.0, 0.0]), instants_s)
    assert found.tolist() == [True, False, True, False, True]
    assert not at_times(instants_s, np.empty(0)).any()


def test_the_report_is_that_of_the_whole_table(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
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
    names, *rows = (plan.out / "flight.csv").read_text(encoding="utf-8").splitlines()
    assert names == ",".join(COLUMNS)
    assert np.array([row.split(",") for row in rows]).astype(float).tobytes() == recording.table.tobytes()


@given(rows=st.lists(st.lists(st.floats(), min_size=3, max_size=3), min_size=1, max_size=5))
def test_a_table_keeps_every_bit(rows: list[list[float]]) -> None:
    *lines, end = csv_rows(np.array(rows)).decode().split("\n")
    assert not end
    read = [[float(value) for value in line.split(",")] for line in lines]
    assert np.array_equal(np.array(read), np.array(rows), equal_nan=True)
    assert np.array_equal(np.signbit(read), np.signbit(rows) & ~np.isnan(rows))


def test_estimation_does_not_depend_on_blocks(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read_estimation(plan, log_of(plan.out), 2.0)
    in_blocks(monkeypatch, SOME_ROWS)
    again = read_estimation(plan, log_of(plan.out), 2.0)
    for name in whole._fields:
        assert np.array_equal(getattr(again, name), getattr(whole, name)), name
    assert read_estimation(plan, log_of(plan.out), 0.0).figures()["nees_mean"] != whole.figures()["nees_mean"]


def test_figures_do_not_depend_on_blocks(plan: FlightPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    for size in (ALL_ROWS, SOME_ROWS, A_BLOCK):
        in_blocks(monkeypatch, size)
        reader = FlightReader(plan)
        flown = FigureSeries(plan, reader.samples, reader)
        drawn.append((flown.over_time(), flown.in_space()))
    for series, path in drawn[1:]:
        assert series.keys() == drawn[0][0].keys()
        for name, values in drawn[0][0].items():
            assert series[name] == pytest.approx(values, rel=1e-12, abs=1e-12, nan_ok=True), name
        assert all(np.array_equal(path[name], values) for name, values in drawn[0][1].items())


def lengthened(plan: FlightPlan, out: Path, rounds: int) -> FlightPlan:
    lasts_s = plan.spec.duration
    longer = FlightPlan.of(FlightSpec.of("lemniscate", profile=plan.spec.profile, duration=rounds * lasts_s, out=out))
    out.mkdir()
    log = log_of(plan.out)
    with (out / "flight.ulg").open("wb") as file:
        file.write(beginning("Test", {}))
        for topic in (TRUTH, DECISION):
            rows = np.concatenate(list(log.blocks(topic)))
            rows = rows[rows[:, 0] < lasts_s]  # the last is the first of the next
            for began_s in np.arange(rounds) * lasts_s:
                times_us = np.rint(1e6 * (rows[:, :1] + began_s))
                for block in np.array_split(np.hstack([times_us, rows[:, 1:]]), 20):
                    file.write(topic.encode(block))
    return longer


def peak_bytes(plan: FlightPlan) -> int:
    tracemalloc.start()
    try:
        flown = FigureSeries(plan, FlightReader(plan).samples)
        keep_flight(plan, SUMMARY, flown.add)
        flown.over_time()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.long
def test_memory_hardly_grows_with_the_flight(plan: FlightPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    in_blocks(monkeypatch, 64)
    monkeypatch.setattr(figure_series, "MAX_POINTS", 1 << 10)
    monkeypatch.setattr(figure_series, "MAX_PATH_POINTS", 1 << 10)
    flights = [lengthened(plan, tmp_path / str(rounds), rounds) for rounds in (4, 20)]
    samples = [FlightReader(flight).samples for flight in flights]
    _loaded, few, many = (peak_bytes(flight) for flight in (flights[1], *flights))
    assert samples[1] - samples[0] > 7000
    assert (many - few) / (samples[1] - samples[0]) < MAX_BYTES_A_SAMPLE


def test_what_is_kept_of_a_sample(plan: FlightPlan) -> None:
    flight = read_flight(FlightReader(plan))
    arrays = [value for value in vars(flight).values() if isinstance(value, np.ndarray)]
    assert sum(array.nbytes for array in arrays) < 57 * len(flight.t)
