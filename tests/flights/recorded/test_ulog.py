"""`flight.ulg` of flights: each number of it as in the tables, by PX4's reader; and its commands."""

import csv
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import psutil
import pytest
from pyulog import ULog, info, messages, params, ulog2csv

from colibri.autopilot.control.profile import load_profile
from colibri.autopilot.parameters.definitions import definitions
from colibri.bench.costs import sensor_frames
from colibri.cli.main import main
from colibri.flights.replay import replay_flight
from colibri.mavlink.ulog.blocks import EVERY_US
from colibri.mavlink.ulog.flight_topics import DECISION, ESTIMATE
from colibri.mavlink.ulog.reader import FlightFile
from colibri.plant.vehicle.description import load_vehicle
from tests.support.recorded import rows
from tools.harness.processes import topic_rows

SPIRAL = ("fly", "spiral", "--quiet", "--no-figures", "--duration", "2")
TOPICS = {"on_state": 18, "on_sensors": 22}
PATIENCE_S = 60.0
KILLED_AT_BYTES = 400_000


def thinned(table: dict[str, Any]) -> dict[str, Any]:
    """Return every fifth control sample."""
    picked = np.rint(1e6 * table["t"]) % EVERY_US == 0
    return {name: column[picked] for name, column in table.items()}


class Flown:
    """A flight: PX4's topics, and of its tables the samples that these have."""

    def __init__(self, folder: Path, *options: str) -> None:
        assert main([*SPIRAL, *options, "--out", str(folder)]) == 0
        self.folder = folder
        self.log = ULog(str(folder / "flight.ulg"))
        assert not self.log.file_corruption
        self.samples, self.decided = thinned(rows(folder / "flight.csv")), thinned(topic_rows(folder, DECISION))

    def __getitem__(self, topic: str) -> dict[str, Any]:
        found: dict[str, Any] = self.log.get_dataset(topic).data
        return found


@pytest.fixture(scope="module")
def on_state(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return Flown(tmp_path_factory.mktemp("state"), "--link", "memory")


@pytest.fixture(scope="module")
def on_sensors(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return Flown(tmp_path_factory.mktemp("sensors"), "--link", "memory", "--feedback", "sensors")


@pytest.fixture(params=TOPICS)
def either(request: pytest.FixtureRequest) -> Flown:
    flown: Flown = request.getfixturevalue(request.param)
    return flown


def single(column: Any) -> Any:
    return column.astype(np.float32)


def same(topic: dict[str, Any], names: str, columns: list[Any]) -> None:
    for name, column in zip(names.split(), columns, strict=True):
        assert np.array_equal(topic[name], single(column)), name


def test_each_number_of_the_truth_is_that_of_the_table(on_state: Flown) -> None:
    position, table = on_state["vehicle_local_position_groundtruth"], on_state.samples
    assert np.array_equal(position["timestamp"], np.rint(1e6 * table["t"]))
    same(position, "x y z", [table["y"], table["x"], -table["z"]])
    rates = on_state["vehicle_angular_velocity_groundtruth"]
    same(rates, "xyz[0] xyz[1] xyz[2]", [table["p"], -table["q"], -table["r"]])
    escs = on_state["esc_status"]
    vehicle = load_vehicle(load_profile("flight").simulation.vehicle)
    to_rpm = vehicle.rad_s_per_speed_unit * 30.0 / np.pi
    for number in range(4):
        assert np.array_equal(escs[f"esc[{number}].esc_rpm"], np.rint(to_rpm * table[f"omega{number + 1}"]))
    attitude = [on_state["vehicle_attitude_groundtruth"][f"q[{place}]"] for place in range(4)]
    w, x, y, z = attitude
    assert np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)) == pytest.approx(table["phi"], abs=1e-6)
    assert np.arcsin(2.0 * (w * y - z * x)) == pytest.approx(-table["theta"], abs=1e-6)
    turned = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) - (np.pi / 2.0 - table["psi"])
    assert np.cos(turned) == pytest.approx(np.ones(len(turned)), abs=1e-6)


def test_each_number_of_a_control_sample_is_that_of_the_tables(on_state: Flown) -> None:
    table = {name: column[: len(on_state.decided["t"])] for name, column in on_state.samples.items()}
    decided = on_state.decided
    steered = on_state["trajectory_setpoint"]
    assert np.array_equal(steered["timestamp"], np.rint(1e6 * decided["t"]))
    same(steered, "position[0] position[1] position[2]", [table["y_ref"], table["x_ref"], -table["z_ref"]])
    same(on_state["vehicle_local_position_setpoint"], "x y z", [table["y_ref"], table["x_ref"], -table["z_ref"]])
    names = "solve_time_us control_step_us cost slack delay_us mass_kg path_lag_s iterations"
    for name in names.split():
        column = decided["qp_iterations" if name == "iterations" else name]
        assert np.array_equal(on_state["mpc_status"][name], single(column), equal_nan=True), name
    codes = "qp_status fallback active_rotors active_increments active_angles active_rates"
    same(on_state["mpc_status"], codes, [decided[name] for name in codes.split()])
    assert np.array_equal(on_state["vehicle_local_position"]["x"], single(table["y"]))  # the frame has single floats
    motors = on_state["actuator_motors"]
    assert all(
        0.0 < motors[f"control[{number}]"].min() <= motors[f"control[{number}]"].max() <= 1.0 for number in range(4)
    )


def test_battery_status_and_what_is_said(on_state: Flown) -> None:
    battery = on_state["battery_status"]
    assert 10.0 < battery["voltage_v"][-1] < 13.0
    assert 5.0 < battery["current_a"][-1] < 30.0
    assert 0.9 < battery["remaining"][-1] < 1.0
    status = on_state["vehicle_status"]
    assert {(a, b) for a, b in zip(status["arming_state"], status["nav_state"], strict=True)} == {(2, 23)}
    assert [said.message for said in on_state.log.logged_messages] == ["spiral, profile flight, lpv-mpc"]
    profile = load_profile("flight")
    defined = definitions(profile, load_vehicle(profile.simulation.vehicle))
    assert on_state.log.initial_parameters == {each.name: each.default for each in defined}


def test_on_sensors_measurements_and_estimates_are_logged(on_sensors: Flown) -> None:
    estimate = thinned(topic_rows(on_sensors.folder, ESTIMATE))
    position = on_sensors["vehicle_local_position"]
    same(
        position,
        "x y z vx vy vz",
        [estimate["y"], estimate["x"], -estimate["z"], estimate["vy"], estimate["vx"], -estimate["vz"]],
    )
    known, measured = on_sensors["estimator_status"], on_sensors["sensor_combined"]
    same(known, "pos_vert_accuracy solution_status_flags", [estimate["sd_z"], estimate["flags"]])
    assert known["pos_horiz_accuracy"] == pytest.approx(np.hypot(estimate["sd_x"], estimate["sd_y"]), rel=1e-6)
    assert np.array_equal(measured["timestamp"], position["timestamp"])
    frames = {it.time_us: it for it in sensor_frames(FlightFile(on_sensors.folder / "flight.ulg").inputs())}
    sent = [frames[time_us.item()] for time_us in measured["timestamp"]]
    for number, sign in enumerate((1.0, -1.0, -1.0)):
        force = np.array([frame.specific_force_flu_m_s2[number] for frame in sent])
        rate = np.array([frame.rate_flu_rad_s[number] for frame in sent])
        same(measured, f"accelerometer_m_s2[{number}] gyro_rad[{number}]", [sign * force, sign * rate])


def test_two_processes_write_one_file_with_the_same_numbers(on_state: Flown, tmp_path: Path) -> None:
    flown = Flown(tmp_path)
    of_time = {"solve_time_us", "control_step_us"}
    for topic in on_state.log.data_list:
        found = flown[topic.name]
        for name in topic.data.keys() - of_time:
            assert np.array_equal(found[name], topic.data[name], equal_nan=True), (topic.name, name)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (info.main, "vehicle_local_position_groundtruth (0, "),
        (params.main, "LPV_"),
        (messages.main, "INFO: spiral, profile flight"),
    ],
)
def test_px4s_commands_read_it(
    command: Callable[[], None],
    said: str,
    either: Flown,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["ulog", str(either.folder / "flight.ulg")])
    command()
    shown = capsys.readouterr()
    assert said in shown.out
    assert not [word for word in ("orrupt", "arning", "rror") if word in shown.out.replace("control_error", "")]
    assert shown.err == ""


@pytest.mark.parametrize(("either", "topics"), TOPICS.items(), indirect=["either"])
def test_px4s_tables_have_each_row(
    either: Flown, topics: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["ulog2csv", str(either.folder / "flight.ulg"), "-o", str(tmp_path)])
    ulog2csv.main()
    assert capsys.readouterr().err == ""
    tables = {path.name for path in tmp_path.iterdir()}
    assert len(tables) == len(either.log.data_list) == topics
    with (tmp_path / "flight_trajectory_setpoint_0.csv").open(encoding="utf-8") as table:
        assert len(list(csv.DictReader(table))) == len(either.decided["t"])


def test_a_log_is_whole_up_to_the_kill_of_both_processes(tmp_path: Path) -> None:
    log = tmp_path / "flight.ulg"
    flight = [sys.executable, "-m", "colibri", "fly", "spiral", "--quiet", "--speed", "4", "--out", str(tmp_path)]
    with subprocess.Popen(flight) as process:
        until_s = monotonic() + PATIENCE_S
        while not log.exists() or log.stat().st_size < KILLED_AT_BYTES:
            assert monotonic() < until_s
            sleep(0.01)
        launcher = psutil.Process(process.pid)
        started = launcher.children(recursive=True)
        assert len(started) >= 2
        for each in (*started, launcher):
            each.kill()
    left = ULog(str(log))
    assert not left.file_corruption
    every_us = {"vehicle_local_position": 40_000, "colibri_truth": 4_000, "colibri_decision": 8_000}
    for topic, interval_us in every_us.items():
        times_us = left.get_dataset(topic).data["timestamp"]
        assert len(times_us) >= 16
        assert np.all(np.diff(times_us) == interval_us)
    assert replay_flight(log).difference is None
