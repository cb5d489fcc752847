"""The log that a ground station downloads from `colibri sitl`: the ULog of the flight, byte for byte."""

from io import BytesIO
from math import nan
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.wire.dialect import mav
from tests.support.log_client import downloaded
from tools.harness.observer import Observer
from tools.harness.sitl_process import Vehicle, vehicle

HEIGHT_M = 2.0
ACCEPTED: int = mav.MAV_RESULT_ACCEPTED


class Flown:
    """A flight of `colibri sitl`, over: what was downloaded of it, and what is on disk."""

    def __init__(self, flown: Vehicle, out: Path) -> None:
        self.content, self.lost = downloaded(flown.port, seed=1)
        self.texts = flown.seen.texts
        self.logs = flown.state / "0" / "logs"
        self.log, self.out = ULog(BytesIO(self.content)), out / "0"


def fly(seen: Observer) -> None:
    for number, params in (
        (mav.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, nan, nan, nan, HEIGHT_M)),
        (mav.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,)),
    ):
        assert seen.command(number, *params) == ACCEPTED
    seen.wait(lambda sight: sight.armed and sight.mode is Mode.HOLD, "the height")
    assert seen.command(mav.MAV_CMD_NAV_LAND) == ACCEPTED
    seen.wait_until_disarmed()


@pytest.fixture(scope="module", params=["state", "sensors"])
def flown(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Flown:
    folder = tmp_path_factory.mktemp("flown")
    out = folder / "out"
    with vehicle(folder, "--out", str(out), "--feedback", request.param, speed=4.0) as flying:
        if request.param == "sensors":
            flying.seen.wait(lambda sight: sight.time_s > 8.0, "an estimate")
        fly(flying.seen)
        return Flown(flying, out)


def test_a_download_over_a_lossy_link_is_the_file_on_disk(flown: Flown) -> None:
    (log,) = flown.logs.iterdir()
    assert log.name == "00001.ulg"
    assert flown.content == log.read_bytes()
    assert flown.lost > 50
    assert not flown.log.file_corruption


def test_the_log_that_has_all_samples_has_the_same_numbers(flown: Flown) -> None:
    beside = ULog(str(flown.out / "flight.ulg"))
    for topic, names in {
        "vehicle_attitude": "q[0] q[1] q[2] q[3]",
        "vehicle_local_position": "x y z vx vy vz",
        "vehicle_angular_velocity": "xyz[0] xyz[1] xyz[2]",
        "actuator_motors": "control[0] control[3]",
        "trajectory_setpoint": "position[2] velocity[2]",
        "mpc_status": "cost iterations solve_time_us qp_status",
    }.items():
        few, all_of_them = flown.log.get_dataset(topic).data, beside.get_dataset(topic).data
        assert set(np.diff(few["timestamp"])) == {40_000}
        at = np.searchsorted(all_of_them["timestamp"], few["timestamp"])
        for name in names.split():
            assert np.array_equal(few[name], all_of_them[name][at], equal_nan=True), (topic, name)


def test_both_logs_have_the_status_texts(flown: Flown) -> None:
    said = [line.message for line in flown.log.logged_messages]
    assert "landed, rotors stopped" in said
    assert set(said) <= set(flown.texts)
    beside = [line.message for line in ULog(str(flown.out / "flight.ulg")).logged_messages]
    assert [text for text in beside if text in said] == said
    assert set(flown.texts) <= set(beside)


def test_it_has_the_battery_the_status_and_the_parameters(flown: Flown) -> None:
    battery = flown.log.get_dataset("battery_status").data
    assert 10.0 < battery["voltage_v"][-1] < 13.0
    assert 0.9 < battery["remaining"][-1] < battery["remaining"][0] <= 1.0
    arming = flown.log.get_dataset("vehicle_status").data["arming_state"].tolist()
    assert arming == [1, *[2] * (len(arming) - 2), 1]
    assert flown.log.initial_parameters["MPC_XY_CRUISE"] > 0.0
