"""The autopilot flies a simulator that speaks PX4's interface: here the plant, which does."""

from pathlib import Path

import numpy as np
import pytest

from tools.harness.processes import Process, running, topic_rows, wait_for


@pytest.mark.long
@pytest.mark.parametrize("vehicle", ["jmavsim", "hummingbird"])
def test_it_hovers_on_sensors_in_a_simulator_of_px4(tmp_path: Path, vehicle: str) -> None:
    out, said = tmp_path / "out", tmp_path / "said"
    said.mkdir()
    serve = ("--serve", "px4", "--link", "tcpin:127.0.0.1:0", "--duration", "20", "--out", str(out))
    plant = Process(said, "plant", *serve, "--vehicle", vehicle)
    with running(plant):
        url = plant.wait_for("listening")["url"].replace("tcpin", "tcp")
        autopilot = Process(
            said, "autopilot", "--simulator", url, "--vehicle", vehicle, "--track", "hover:height=3", "--out", str(out)
        )
        with running(autopilot):
            assert plant.wait() == 0
    flown = topic_rows(out)
    settled = flown["t"] > 12.0
    assert np.abs(flown["z"][settled] - 3.0).max() < 1.5
    assert np.hypot(flown["x"], flown["y"])[settled].max() < 1.5
    for axis in "xyz":
        assert np.ptp(flown[axis][settled]) < 0.5


@pytest.mark.long
def test_it_outlives_the_seconds_in_which_it_knows_nothing(tmp_path: Path) -> None:
    """Ground stations are told of a vehicle each second; at real time the first estimate takes longer."""
    plant = Process(tmp_path, "plant", "--serve", "px4", "--link", "tcpin:127.0.0.1:0", "--speed", "1")
    with running(plant):
        url = plant.wait_for("listening")["url"].replace("tcpin", "tcp")
        autopilot = Process(tmp_path, "autopilot", "--simulator", url, "--gcs", "udpin:127.0.0.1:0")
        with running(autopilot):
            wait_for(lambda: any(event["sim_time_s"] > 2.5 for event in plant.events("progress")), "the plant")
            assert autopilot.process.poll() is None, autopilot.errors()
            assert not any(event["armed"] for event in autopilot.events("status"))


def test_a_simulator_sends_no_state_and_needs_sensors(tmp_path: Path) -> None:
    autopilot = Process(tmp_path, "autopilot", "--simulator", "tcp:127.0.0.1:4560", "--vehicle", "hummingbird-thesis")
    with running(autopilot):
        assert autopilot.wait() == 2
    assert "has no sensors" in autopilot.errors()
