"""The log that a ground station downloads from `colibri sitl`: the ULog of the flight, byte for byte."""

import socket
from contextlib import closing, suppress
from io import BytesIO
from math import nan
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from pyulog import ULog

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from tests.support.log_conversations import DownloadLog, ListLogs
from tools.harness.processes import vehicle

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED


def downloaded(port: int) -> bytes:
    client, target = Client(245, 190), (1, AUTOPILOT_COMPONENT)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sock:
        sock.connect(("127.0.0.1", port))
        sock.settimeout(0.02)

        def carry(conversation: Conversation) -> None:
            client.begin(conversation)
            give_up_s = monotonic() + 60.0
            while conversation.result is None:
                assert monotonic() < give_up_s, "the log does not come"
                for datagram in client.poll(round(monotonic() * 1e6)):
                    sock.send(datagram)
                with suppress(TimeoutError):
                    client.receive(sock.recv(4096), round(monotonic() * 1e6))
            assert conversation.accepted

        carry(logs := ListLogs(target))
        ((number, size),) = logs.sizes.items()
        carry(log := DownloadLog(target, number, size))
    return log.data


@pytest.mark.parametrize("feedback", ["state", pytest.param("sensors", marks=pytest.mark.long)])
def test_a_download_is_the_file_on_disk(tmp_path: Path, feedback: str) -> None:
    with vehicle(tmp_path, "--out", str(tmp_path / "out"), "--feedback", feedback, speed=4.0) as flying:
        seen = flying.seen
        if feedback == "sensors":
            seen.wait(lambda sight: sight.time_s > 8.0, "an estimate")
        assert seen.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, 2.0) == ACCEPTED
        assert seen.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
        seen.wait(lambda sight: sight.armed and sight.mode is Mode.HOLD, "the height")
        assert seen.command(mav.MAV_CMD_NAV_LAND) == ACCEPTED
        seen.wait_until_disarmed()
        content = downloaded(flying.port)
        (kept,) = (flying.state / "0" / "logs").glob("00001.ulg")
        assert content == kept.read_bytes()
    log = ULog(BytesIO(content))
    beside = ULog(str(tmp_path / "out" / "0" / "flight.ulg"))  # whole once the process has ended
    assert not log.file_corruption
    _has_the_numbers_of(log, beside)
    said, said_beside = ([line.message for line in each.logged_messages] for each in (log, beside))
    assert "Disarmed by landing" in said
    assert set(said) <= set(seen.texts) <= set(said_beside)
    assert [text for text in said_beside if text in said] == said
    battery = log.get_dataset("battery_status").data
    assert 10.0 < battery["voltage_v"][-1] < 13.0
    assert 0.9 < battery["remaining"][-1] < battery["remaining"][0] <= 1.0
    arming = log.get_dataset("vehicle_status").data["arming_state"].tolist()
    assert arming == [1, *[2] * (len(arming) - 2), 1]
    assert log.initial_parameters["MPC_XY_CRUISE"] > 0.0


def _has_the_numbers_of(log: ULog, beside: ULog) -> None:
    """Compare with the log that has all samples."""
    for topic, names in {
        "vehicle_attitude": "q[0] q[1] q[2] q[3]",
        "vehicle_local_position": "x y z vx vy vz",
        "vehicle_angular_velocity": "xyz[0] xyz[1] xyz[2]",
        "actuator_motors": "control[0] control[3]",
        "trajectory_setpoint": "position[2] velocity[2]",
        "mpc_status": "cost iterations solve_time_us qp_status",
    }.items():
        few, all_of_them = log.get_dataset(topic).data, beside.get_dataset(topic).data
        assert set(np.diff(few["timestamp"])) == {40_000}
        at = np.searchsorted(all_of_them["timestamp"], few["timestamp"])
        for name in names.split():
            assert np.array_equal(few[name], all_of_them[name][at], equal_nan=True), (topic, name)
