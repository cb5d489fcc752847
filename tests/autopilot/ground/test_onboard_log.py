"""The log that ground stations download: what is recorded, and that it is whole at every instant."""

from io import BytesIO
from pathlib import Path

import pytest
from pyulog import ULog

from colibri.autopilot.ground.onboard_log import DATAFLASH, ULOG, LogFormat, LoggedVehicle, OnboardLog
from colibri.mavlink.files.memory import MemoryFiles
from colibri.mavlink.parameters.store import Parameter, Parameters, ParamType
from colibri.mavlink.services.statustext import INFO, Line
from colibri.mavlink.telemetry.snapshot import TelemetrySnapshot
from colibri.mavlink.ulog.blocks import EVERY_US
from colibri.mavlink.wire.dialect import mav
from tests.support.dataflash import read_dataflash

SAMPLE_US = 8_000


class Flight:
    def __init__(self, memory: MemoryFiles | None = None, form: LogFormat = ULOG) -> None:
        self.form = form
        self.memory = memory or MemoryFiles()
        self.memory.make_folder(("logs",))
        self.parameters = Parameters([Parameter(name="A", kind=ParamType.REAL, default=1.0, description="")])
        self.log = self.begun()
        self.now_us = 0

    def begun(self) -> OnboardLog:
        return OnboardLog(LoggedVehicle("Test", 1, self.parameters, "ArduCopter V4.7.0"), self.memory, self.form)

    def run(self, samples: int, *said: str, armed: bool = True) -> None:
        for number in range(samples):
            self.now_us += SAMPLE_US
            snapshot = TelemetrySnapshot(time_us=self.now_us, armed=armed)
            lines = [Line(INFO, text) for text in said] if number == 0 else []
            self.log.update(snapshot, lines, self.now_us, armed=armed)
            self.log.update(snapshot, [], self.now_us + SAMPLE_US // 2, armed=armed)  # a frame between two samples

    def content(self, name: str) -> bytes:
        reading = self.memory.open(("logs", name))
        return reading.read(0, reading.size)

    def read(self, name: str = "00001.ulg") -> ULog:
        log = ULog(BytesIO(self.content(name)))
        assert not log.file_corruption
        return log


@pytest.fixture
def flight() -> Flight:
    return Flight()


def times_us(log: ULog, topic: str = "vehicle_local_position") -> list[int]:
    found: list[int] = log.get_dataset(topic).data["timestamp"].tolist()
    return found


def names(flight: Flight) -> list[str]:
    return [entry.name for entry in flight.memory.list(("logs",))]


def test_there_is_one_from_arming_to_disarming(flight: Flight) -> None:
    flight.run(10, "ready", armed=False)
    assert names(flight) == []
    flight.run(101, "Armed")
    flight.run(1, "Disarmed by landing", armed=False)
    flight.run(10, "ready again", armed=False)
    log = flight.read()
    assert [said.message for said in log.logged_messages] == ["Armed", "Disarmed by landing"]
    assert times_us(log) == list(range(3 * EVERY_US, 112 * SAMPLE_US, EVERY_US))
    assert log.get_dataset("vehicle_status").data["arming_state"].tolist() == [2, 1]
    flight.run(5)
    assert names(flight) == ["00001.ulg", "00002.ulg"]


def test_who_was_killed_in_flight_begins_another_one(flight: Flight) -> None:
    flight.run(300)
    flight.log = flight.begun()
    flight.run(300)
    flight.log.close()
    assert names(flight) == ["00001.ulg", "00002.ulg"]
    assert flight.log.name is None
    first, second = (times_us(flight.read(name)) for name in names(flight))
    assert first[0] < second[0]
    assert second[-1] > flight.now_us - EVERY_US


def test_as_dataflash_a_log_opens_in_ardupilots_reader(tmp_path: Path) -> None:
    flight = Flight(form=DATAFLASH)
    flight.run(50, "Arming motors")
    flight.parameters.set("A", 2.5)
    flight.run(50)
    flight.run(1, armed=False)
    assert names(flight) == ["00000001.BIN"]
    kind, found = read_dataflash(tmp_path / "log.BIN", flight.content("00000001.BIN"))
    assert kind == mav.MAV_TYPE_QUADROTOR
    assert [row.Message for row in found["MSG"]] == ["ArduCopter V4.7.0", "Arming motors"]
    assert [row.Value for row in found["PARM"]] == [1.0, 2.5]
    assert [row.Id for row in found["EV"]] == [10, 11]
    assert [row.ArmState for row in found["ARM"]] == [1, 0]
    assert [row.TimeUS for row in found["ATT"]] == [8_000, *range(40_000, 808_001, 40_000)]
