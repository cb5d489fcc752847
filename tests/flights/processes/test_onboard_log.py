"""The log that a ground station downloads from `colibri sitl`: the ULog of the flight, byte for byte."""

import socket
from contextlib import closing, suppress
from io import BytesIO
from math import nan
from time import monotonic
from typing import NamedTuple

import numpy as np
import pytest
from pyulog import ULog

from colibri.autopilot.commander.rules.modes import Mode
from colibri.mavlink.client.client import Client
from colibri.mavlink.client.conversation import Conversation
from colibri.mavlink.wire.dialect import AUTOPILOT_COMPONENT, mav
from tests.support.log_conversations import DownloadLog, ListLogs
from tools.harness.processes import vehicle

pytestmark = pytest.mark.usefixtures("forked")

ACCEPTED: int = mav.MAV_RESULT_ACCEPTED


class Flown(NamedTuple):
    """A flight of `colibri sitl`, over: what was downloaded of it, what was said, and the logs on disk."""

    content: bytes
    log: ULog
    texts: list[str]
    kept: bytes
    beside: ULog


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


@pytest.fixture(scope="module", params=["state", pytest.param("sensors", marks=pytest.mark.long)])
def flown(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Flown:
    folder = tmp_path_factory.mktemp("flown")
    out = folder / "out"
    with vehicle(folder, "--out", str(out), "--feedback", request.param, speed=4.0) as flying:
        if request.param == "sensors":
            flying.seen.wait(lambda sight: sight.time_s > 8.0, "an estimate")
        seen = flying.seen
        assert seen.command(mav.MAV_CMD_NAV_TAKEOFF, 0.0, 0.0, 0.0, nan, nan, nan, 2.0) == ACCEPTED
        assert seen.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
        seen.wait(lambda sight: sight.armed and sight.mode is Mode.HOLD, "the height")
        assert seen.command(mav.MAV_CMD_NAV_LAND) == ACCEPTED
        seen.wait_until_disarmed()
        content = downloaded(flying.port)
        (kept,) = (flying.state / "0" / "logs").glob("00001.ulg")
        kept_bytes, texts = kept.read_bytes(), seen.texts
    beside = ULog(str(out / "0" / "flight.ulg"))  # whole once the process has ended
    return Flown(content, ULog(BytesIO(content)), texts, kept_bytes, beside)


def test_a_download_is_the_file_on_disk(flown: Flown) -> None:
    assert flown.content == flown.kept
    assert not flown.log.file_corruption


def test_the_log_that_has_all_samples_has_the_same_numbers(flown: Flown) -> None:
    for topic, names in {
        "vehicle_attitude": "q[0] q[1] q[2] q[3]",
        "vehicle_local_position": "x y z vx vy vz",
        "vehicle_angular_velocity": "xyz[0] xyz[1] xyz[2]",
        "actuator_motors": "control[0] control[3]",
        "trajectory_setpoint": "position[2] velocity[2]",
        "mpc_status": "cost iterations solve_time_us qp_status",
    }.items():
        few, all_of_them = flown.log.get_dataset(topic).data, flown.beside.get_dataset(topic).data
        assert set(np.diff(few["timestamp"])) == {40_000}
        at = np.searchsorted(all_of_them["timestamp"], few["timestamp"])
        for name in names.split():
            assert np.array_equal(few[name], all_of_them[name][at], equal_nan=True), (topic, name)


def test_both_logs_have_the_status_texts(flown: Flown) -> None:
    said = [line.message for line in flown.log.logged_messages]
    assert "Disarmed by landing" in said
    assert set(said) <= set(flown.texts)
    beside = [line.message for line in flown.beside.logged_messages]
    assert [text for text in beside if text in said] == said
    assert set(flown.texts) <= set(beside)


def test_it_has_the_battery_the_status_and_the_parameters(flown: Flown) -> None:
    battery = flown.log.get_dataset("battery_status").data
    assert 10.0 < battery["voltage_v"][-1] < 13.0
    assert 0.9 < battery["remaining"][-1] < battery["remaining"][0] <= 1.0
    arming = flown.log.get_dataset("vehicle_status").data["arming_state"].tolist()
    assert arming == [1, *[2] * (len(arming) - 2), 1]
    assert flown.log.initial_parameters["MPC_XY_CRUISE"] > 0.0
